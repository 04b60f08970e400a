// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what commands are told, and what they find of earlier runs
#include "engine/job/piece_record.h"
#include "engine/job/run_folder.h"
#include "engine/world/region_store.h"
#include "runtime/base/json.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/editing/editing.h"
#include "tools/run/job_tree.h"
#include "tools/run/manifest.h"

#include <fstream>
#include <unistd.h>

namespace semrover::fuzz {

namespace runs {

void json(Bytes input)
{
    const auto read = parse_json(text_of(input), "j.json");
    if (!accepts(read))
        return;
    const auto again = parse_json(read->dump(), "again");
    if (!again || *again != *read)
        found("JSON that was read is another when it is written");
}

void edit_script(Bytes input)
{
    const auto read = read_edit_script(InputFile(input, "e.json"));
    if (!accepts(read))
        return;
    for (const EditOperation& operation : *read)
        if (!parse_edit_script(Json::array({operation_json(operation)}), "", "again") &&
            operation.kind != EditOperation::Kind::insert)
            found("an operation that was read is refused when it is written");
}

void job_tree(Bytes input)
{
    for (const char* name : {"job.toml", "job.json"})
        (void)accepts(read_job_tree(InputFile(input, name)));
}

void manifest(Bytes input)
{
    const InputFolder folder(input, "manifest.json");
    const auto read = read_manifest(folder);
    if (accepts(read))
        (void)differences(folder, *read);
}

// a folder on the disk, as runs lock theirs
void run_folder(Bytes input)
{
    static const Path work = fmt::format("/dev/shm/semrover-fuzz-{}", getpid());
    namespace fs = std::filesystem;
    fs::remove_all(work);
    const InputFolder folder(input, "run.json");
    for (const std::string& name : folder.names()) {
        const auto bytes = read_file(folder.path() / name, kMebibyte);
        if (!bytes || name.find("lock") != std::string::npos || !make_folder((work / name).parent_path()))
            continue;
        std::ofstream(work / name, std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes->data()), std::streamsize(bytes->size()));
    }
    const auto summary = read_json(folder.path() / "run.json");
    const Json settings = summary && summary->is_object() ? summary->value("settings", Json::object()) : Json::object();
    if (make_folder(work)) {
        auto run = RunFolder::open(work, settings, false);
        // usage: what is there may be finished, or a shard set
        if (run || (run.error().code != ErrorCode::usage && accepts(run))) {
            (void)load_regions(*run);
            (void)PieceRecord(*run,
                              [](const std::string& piece) { return std::vector<Path>{work / "regions" / piece}; });
        }
    }
    fs::remove_all(work);
}

constexpr FuzzTarget kTargets[] = {
    {"json", "*.json *.gltf", json},
    {"edit_script", "*.json", edit_script},
    {"job_tree", "*.toml *.json", job_tree},
    {"manifest", "*.folder *manifest.json", manifest},
};

} // namespace runs

std::span<const FuzzTarget> run_targets()
{
    return runs::kTargets;
}

} // namespace semrover::fuzz
