// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <unistd.h>

// `refine` of a few small frames with a network of the golden cases
namespace semrover {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class RefineCase : public testing::Test {
  protected:
    static constexpr uint32_t kWidth = 56, kHeight = 40, kFrames = 3;
    static constexpr const char* kSettings = " --steps 3 ";

    RefineCase()
    {
        put_renderer_model(folder_ / "model");
        put_buffers(folder_ / "in", kFrames, kWidth, kHeight);
    }

    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string arguments(std::string_view output, std::string_view input = "in") const
    {
        return "refine " + path(input) + " -m " + path("model") + " -o " + path(output) + " --quiet" + kSettings;
    }
    // a grid, street.sgrid, and the options of a drive along it by these metres
    std::string put_drive(std::initializer_list<double> places) const
    {
        EXPECT_TRUE(write_grid(folder_ / "street.sgrid", street()));
        std::string poses;
        for (const double x : places)
            poses += fmt::format("{0} {0} 3.6 1.6 -0.5 0.5 -0.5 0.5\n", x);
        folder_.put("path.tum", poses);
        return " --path " + path("path.tum") + " -W 56 -H 40 ";
    }
    ProgramResult refine(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        return semrover_program(arguments(output, input) + more);
    }
    Json report(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        const ProgramResult result = refine(output, more + " --json", input);
        EXPECT_EQ(result.code, 0) << result.err;
        return Json::parse(result.out, nullptr, false);
    }
    // bytes of every frame and latent under `output`, by name
    std::map<std::string, std::string> results(std::string_view output, std::string_view camera = "") const
    {
        std::map<std::string, std::string> files;
        for (const char* kind : {"frames", "latents"})
            for (const auto& entry : fs::directory_iterator(folder_ / output / kind / camera))
                files[std::string(kind) + "/" + entry.path().filename().string()] = contents(entry.path());
        return files;
    }
    std::map<std::string, std::string> refined(std::string_view output, const std::string& more = "",
                                               std::string_view input = "in") const
    {
        const ProgramResult result = refine(output, more, input);
        EXPECT_EQ(result.code, 0) << result.err;
        return results(output);
    }
    size_t journal_lines(std::string_view output) const
    {
        return size_t(std::ranges::count(contents(folder_ / output / "journal.jsonl"), '\n'));
    }
    // starts a run, waits until `lines` pieces are saved and sends it `signal`; its exit status
    int stop_after(std::string_view output, size_t lines, int signal, const std::string& more = "",
                   std::string_view input = "in") const
    {
        ChildProgram child(arguments(output, input) + more);
        while (journal_lines(output) < lines && child.running())
            usleep(500);
        return child.stop(signal);
    }

    ScratchFolder folder_;
};

} // namespace semrover
