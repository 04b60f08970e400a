// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// fuzz TARGET [libFuzzer's options] [folders and files]; fuzz --list: the targets, most bytes and inputs of each
#include "tests/fuzz/coverage.h"
#include "tests/fuzz/fuzz_target.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace semrover::fuzz {

namespace {

constexpr const char* kVariable = "SEMROVER_FUZZ_TARGET"; // for processes that libFuzzer starts

const FuzzTarget* target = nullptr;

std::vector<FuzzTarget> all_targets()
{
    std::vector<FuzzTarget> all;
    for (const auto targets : {model_targets(), scene_targets(), mesh_targets(), picture_targets(), camera_targets(),
                               annotation_targets(), folder_targets(), run_targets(), capi_targets()})
        all.insert(all.end(), targets.begin(), targets.end());
    return all;
}

void choose(const std::string& name)
{
    static const std::vector<FuzzTarget> all = all_targets();
    if (name == "--list") {
        for (const FuzzTarget& t : all)
            std::printf("%s\t%u\t%s\n", t.name, t.most_bytes, t.inputs);
        std::exit(0);
    }
    const auto of_name = std::ranges::find(all, name, [](const FuzzTarget& t) { return std::string(t.name); });
    if (of_name == all.end()) {
        std::fprintf(stderr, "fuzz: no target %s; fuzz --list names them\n", name.c_str());
        std::exit(2);
    }
    target = &*of_name;
}

int run(Bytes input)
{
    if (input.size() > target->most_bytes)
        return -1;
    begin_input();
    target->run(input);
    if (const uint64_t most = target->per_byte * input.size() + target->more; most_memory() > most)
        found(fmt::format("{} bytes of memory for {} of the input, expected {} at most", most_memory(), input.size(),
                          most));
    return 0;
}

} // namespace

} // namespace semrover::fuzz

extern "C" int LLVMFuzzerInitialize(int* count, char*** arguments)
{
    begin_coverage();
    char** a = *arguments;
    if (*count > 1 && (a[1][0] != '-' || std::strcmp(a[1], "--list") == 0)) {
        setenv(semrover::fuzz::kVariable, a[1], 1);
        std::copy(a + 2, a + *count + 1, a + 1); // and the NULL behind them
        --*count;
    }
    const char* name = std::getenv(semrover::fuzz::kVariable);
    semrover::fuzz::choose(name ? name : "");
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size)
{
    return semrover::fuzz::run(std::as_bytes(std::span(data, size)));
}
