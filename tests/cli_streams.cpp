// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// outputs that are closed or full, and a cache that cannot be kept
#include "runtime/base/json.h"
#include "tests/support/program.h"

namespace semrover {
namespace cli_streams_test {

const std::string kGrid = std::string(SEMROVER_SOURCE_DIR) + "/assets/scenes/street.semantic.sgrid";

TEST(cli_streams, an_error_that_nobody_reads_keeps_its_exit_code)
{
    for (const char* nobody : {" 2>&-", " 2>/dev/full", " >&- 2>&-", " <&- >&- 2>&-"}) {
        EXPECT_EQ(semrover_program(std::string("inspect /nowhere/x.sgrid") + nobody).code, 3) << nobody;
        EXPECT_EQ(semrover_program(std::string("inspect --no-such-option") + nobody).code, 2) << nobody;
        EXPECT_EQ(semrover_program(std::string("streets --seed nan") + nobody).code, 2) << nobody;
    }
}

TEST(cli_streams, warnings_and_progress_that_nobody_reads_do_not_stop_the_work)
{
    const ScratchFolder folder;
    const std::string mesh = folder.put("m.obj", "v 0 0 0\nv 4 0 0\nv 4 4 0\nf 1 2 3\n").string();
    const std::string line = "voxelize " + mesh + " --default-label road -y -o ";
    const ProgramResult said = semrover_program(line + (folder / "a.sgrid").string());
    ASSERT_EQ(said.code, 0) << said.err;
    EXPECT_NE(said.err.find("warning"), std::string::npos);
    for (const char* nobody : {" 2>&-", " 2>/dev/full"}) {
        EXPECT_EQ(semrover_program(line + (folder / "b.sgrid").string() + nobody).code, 0) << nobody;
        EXPECT_EQ(contents(folder / "b.sgrid"), contents(folder / "a.sgrid")) << "messages went into the file";
    }
}

TEST(cli_streams, results_that_cannot_be_printed_are_an_error)
{
    for (const char* lost : {" >&-", " >/dev/full"})
        for (const char* line : {"labels", "labels --json", "--help", "--help --json", "streets --help"})
            expect_error(semrover_program(line + std::string(lost)), 3, "write to");
    // with nothing to read it either
    EXPECT_EQ(semrover_program("labels >&- 2>&-").code, 3);
    EXPECT_EQ(semrover_program("labels >/dev/full 2>/dev/full").code, 3);
}

TEST(cli_streams, a_cache_that_is_a_folder_is_not_used)
{
    const ScratchFolder folder;
    const std::string line = "XDG_CACHE_HOME=" + folder.path().string() + " " SEMROVER_BINARY;
    const std::string bench = " bench gemm --m 8 --n 8 --k 8 --json";
    ASSERT_EQ(run_program_line("env " + line, bench).code, 0);
    for (const auto& entry : std::filesystem::directory_iterator(folder / "semrover")) {
        const auto file = entry.path();
        std::filesystem::remove(file);
        std::filesystem::create_directory(file);
    }
    const ProgramResult again = run_program_line("env " + line, bench);
    EXPECT_EQ(again.code, 0) << again.err;
    std::filesystem::remove_all(folder / "semrover");
    folder.put("semrover", "a file in place of the folder");
    EXPECT_EQ(run_program_line("env " + line, bench).code, 0);
}

TEST(cli_streams, a_folder_of_results_has_the_mode_that_the_umask_leaves)
{
    const ScratchFolder folder;
    const std::string out = (folder / "s").string();
    const std::string line = " streets -o " + out + " --length 30 --no-grids -q -y";
    ASSERT_EQ(run_program_line("umask 077; exec " SEMROVER_BINARY, line).code, 0);
    using std::filesystem::perms;
    EXPECT_EQ(std::filesystem::status(out).permissions(), perms(0700));
    std::filesystem::remove_all(out);
    ASSERT_EQ(run_program_line("umask 027; exec " SEMROVER_BINARY, line).code, 0);
    EXPECT_EQ(std::filesystem::status(out).permissions(), perms(0750));
}

TEST(cli_streams, names_that_are_no_utf8_are_names)
{
    const ScratchFolder folder;
    const std::string odd = "n\xff\xfe";
    const auto path = [&](const std::string& name) { return "'" + (folder / odd / (name + odd)).string(); };
    std::filesystem::create_directory(folder / odd);
    std::filesystem::copy(kGrid, folder / odd / ("street" + odd + ".sgrid"));
    folder.put(odd + "/path" + odd + ".tum", "0 1 0 1.5 0.5 -0.5 0.5 -0.5\n1 2 0 1.5 0.5 -0.5 0.5 -0.5\n");
    const std::string street = path("street") + ".sgrid'", small = path("small") + ".sgrid'";
    const std::string model = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
    const std::string generate = " -m " + model + " --steps 1 --region-size 40 --coverage-threshold 12 --json -o ";
    for (const std::string& line :
         {"inspect --json " + street, "edit " + street + " --cut --box 0,-40,-5:12,40,20 --json -o " + small,
          "generate " + small + generate + path("made") + ".sgrid'",
          "render " + path("made") + ".sgrid' --path " + path("path") + ".tum' -W 32 -H 24 --json -o " +
              path("frames") + "'",
          "convert " + path("made") + ".sgrid' " + path("made") + ".ply' --json",
          "convert " + path("frames") + "/transforms.json' " + path("cameras") + ".tum' --json",
          "page --grid " + street + " --json -o " + path("page") + ".html'"})
        for (int again = 0; again < 2; ++again) {
            const ProgramResult result = semrover_program(line + (again ? " -y" : ""));
            EXPECT_EQ(result.code, 0) << line << "\n" << result.err;
            EXPECT_TRUE(parse_json(result.out, "output")) << line << "\n" << result.out;
        }
}

TEST(cli_streams, names_that_are_too_long_are_refused_by_name)
{
    const ScratchFolder folder;
    const std::string name(300, 'n');
    for (const char* line : {"tile GRID -o OUT", "edit GRID --remove car -o OUT", "convert GRID OUT.ply",
                             "streets --length 30 --no-grids -o OUT", "convert GRID OUT.label --to semantickitti"}) {
        std::string text = line;
        text.replace(text.find("OUT"), 3, (folder / name).string());
        if (const size_t at = text.find("GRID"); at != std::string::npos)
            text.replace(at, 4, kGrid);
        const ProgramResult r = semrover_program(text);
        EXPECT_EQ(r.code, 3) << text << r.err;
        EXPECT_NE(r.err.find(name.substr(0, 100)), std::string::npos) << r.err;
        EXPECT_NE(r.err.find("File name too long"), std::string::npos) << r.err;
    }
    EXPECT_EQ(folder.entries(), 0u);
}

} // namespace cli_streams_test
} // namespace semrover
