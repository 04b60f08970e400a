// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
// what others put into a run's folder
#include "engine/job/outputs.h"
#include "engine/world/region_store.h"
#include "runtime/base/diagnostics.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <dlfcn.h>
#include <functional>
#include <sys/file.h>
#include <sys/stat.h>
#include <utility>

// a file system without locks: this program's own flock fails so; 0: it is libc's. And what others do just before it
static int flock_error = 0;
static std::function<void()> before_flock;
extern "C" int flock(int fd, int operation) noexcept
{
    if (const auto meanwhile = std::exchange(before_flock, nullptr))
        meanwhile();
    if (!flock_error)
        return reinterpret_cast<int (*)(int, int)>(dlsym(RTLD_NEXT, "flock"))(fd, operation);
    errno = flock_error;
    return -1;
}

namespace semrover {
namespace engine_run_folder_test {

namespace fs = std::filesystem;

const Json kSettings = {{"command", "test"}, {"seed", 1}};

TEST(engine_run_folder, a_name_that_is_too_long_is_an_error_and_no_exception)
{
    const ScratchFolder folder;
    const fs::path name = folder / std::string(300, 'x');
    EXPECT_TRUE(says(check_writable(name, false), "File name too long"));
    EXPECT_TRUE(says(RunFolder::open(name, kSettings, false), "File name too long"));
    EXPECT_TRUE(says(open_run(name, kSettings, true), "File name too long"));
}

TEST(engine_run_folder, a_link_is_refused_by_name_and_its_target_stays)
{
    for (const char* name : {"journal.jsonl", "lock", "run.json", "regions", "frames", "frames/front"})
        for (const bool restart : {false, true}) {
            const ScratchFolder folder;
            const fs::path run = folder / "run";
            // of an earlier run, so that the journal would be read and cut
            ASSERT_TRUE(RunFolder::open(run, kSettings, false, {{"regions"}, {"frames"}}));
            const fs::path target = folder.put("target", "precious, and no journal");
            fs::create_directories((run / name).parent_path());
            fs::remove_all(run / name);
            fs::create_symlink(target, run / name);
            EXPECT_TRUE(says(RunFolder::open(run, kSettings, restart, {{"regions"}, {"frames"}}),
                             std::string(name) + "' is a link"));
            EXPECT_EQ(contents(target), "precious, and no journal") << name;
        }
}

TEST(engine_run_folder, a_folder_that_is_a_link_is_refused)
{
    const ScratchFolder folder;
    fs::create_directory(folder / "target");
    for (const char* target : {"target", "nowhere"}) {
        fs::create_symlink(target, folder / "run");
        for (const bool restart : {false, true})
            EXPECT_TRUE(says(RunFolder::open(folder / "run", kSettings, restart), "run' is a link"));
        fs::remove(folder / "run");
    }
    EXPECT_TRUE(fs::is_empty(folder / "target"));
    EXPECT_FALSE(fs::exists(folder / "nowhere"));
    fs::create_directory_symlink("target", folder / "run");
    EXPECT_TRUE(RunFolder::open(folder / "run/", kSettings, false)); // who names it so means what it leads to
    EXPECT_TRUE(fs::exists(folder / "target/run.json"));
}

TEST(engine_run_folder, a_link_to_nothing_creates_nothing)
{
    for (const char* name : {"journal.jsonl", "lock"}) {
        const ScratchFolder folder;
        fs::create_directories(folder / "run");
        fs::create_symlink(folder / "new", folder / (std::string("run/") + name));
        EXPECT_TRUE(says(RunFolder::open(folder / "run", kSettings, false), "is a link"));
        EXPECT_FALSE(fs::exists(folder / "new"));
    }
}

TEST(engine_run_folder, a_pipe_is_not_waited_for)
{
    for (const char* name : {"journal.jsonl", "lock", "run.json"}) {
        const ScratchFolder folder;
        fs::create_directories(folder / "run");
        if (std::string_view(name) == "journal.jsonl")
            folder.put("run/run.json", Json{{"settings", kSettings}, {"state", "finished"}}.dump());
        ASSERT_EQ(mkfifo((folder / "run" / name).c_str(), 0600), 0);
        const auto opened = RunFolder::open(folder / "run", kSettings, false);
        // a run that begins removes the old journal, whatever it is
        const bool begins = std::string_view(name) == "journal.jsonl";
        EXPECT_TRUE(begins ? testing::AssertionResult(opened.has_value()) : says(opened, name)) << name;
    }
}

TEST(engine_run_folder, a_second_process_finds_it_busy)
{
    const ScratchFolder folder;
    const auto first = RunFolder::open(folder / "run", kSettings, false);
    ASSERT_TRUE(first);
    for (const bool restart : {false, true}) {
        const auto second = RunFolder::open(folder / "run", kSettings, restart);
        EXPECT_TRUE(says(second, "another process works in"));
        EXPECT_EQ(second.error().code, ErrorCode::busy);
    }
}

TEST(engine_run_folder, a_lock_that_was_removed_before_it_was_taken_is_none)
{
    const ScratchFolder folder;
    std::optional<Result<RunFolder>> other;
    before_flock = [&] { // one that had it ends, and another one begins
        fs::remove(folder / "run/lock");
        other.emplace(RunFolder::open(folder / "run", kSettings, false));
    };
    EXPECT_TRUE(says(RunFolder::open(folder / "run", kSettings, false), "another process works in"));
    ASSERT_TRUE(*other);
    other.reset();
    before_flock = [&] { fs::remove(folder / "run/lock"); };
    const auto last = RunFolder::open(folder / "run", kSettings, false);
    ASSERT_TRUE(last);
    EXPECT_TRUE(says(RunFolder::open(folder / "run", kSettings, false), "another process works in"));
}

TEST(engine_run_folder, goes_on_without_locks_and_says_so_once)
{
    static std::vector<std::string> said;
    set_diagnostic_callback([](void*, const char* line) { said.push_back(line); });
    const ScratchFolder folder;
    for (const int error : {ENOLCK, ENOSYS, EOPNOTSUPP, EBADF}) {
        flock_error = error;
        EXPECT_TRUE(RunFolder::open(folder / "run", kSettings, false)) << error;
    }
    flock_error = EIO;
    EXPECT_TRUE(says(RunFolder::open(folder / "run", kSettings, false), "cannot lock"));
    flock_error = 0;
    set_diagnostic_callback(nullptr);
    ASSERT_EQ(said.size(), 1u);
    EXPECT_NE(said.front().find("warning: "), std::string::npos);
    EXPECT_NE(said.front().find("a file system without locks"), std::string::npos);
}

TEST(engine_run_folder, a_run_json_that_is_none_is_an_error_and_yes_starts_over)
{
    for (const char* text : {"[]", "null", "3", "\"x\"", "{}", R"({"settings": {}})", R"({"settings": 1, "state": 2})",
                             R"({"settings": {}, "state": []})"}) {
        const ScratchFolder folder;
        fs::create_directories(folder / "run");
        folder.put("run/run.json", text);
        EXPECT_TRUE(says(open_run(folder / "run", kSettings, false), "run.json")) << text;
        EXPECT_TRUE(open_run(folder / "run", kSettings, true)) << text;
    }
}

TEST(engine_run_folder, lines_of_the_journal_with_other_types_are_no_regions)
{
    const ScratchFolder folder;
    {
        auto run = RunFolder::open(folder / "run", kSettings, false);
        ASSERT_TRUE(run);
        ASSERT_TRUE(save_region(*run, {.region = 0, .targets = {1}, .points = {0, 0, 0}, .colors = {1, 2, 3}}));
        for (const Json& odd : {Json(nullptr), Json(1), Json{{"region", 0}, {"xxh64", 12}}, Json{{"region", 0}},
                                Json{{"region", "0"}, {"xxh64", ""}}, Json{{"region", 0}, {"xxh64", {1, 2}}}})
            ASSERT_TRUE(run->append(odd));
    }
    const auto again = RunFolder::open(folder / "run", kSettings, false);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->entries().size(), 7u);
    EXPECT_EQ(load_regions(*again).size(), 1u);
}

} // namespace engine_run_folder_test
} // namespace semrover
