// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
#include "engine/job/file_queue.h"
#include "runtime/base/made_files.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <atomic>
#include <cstdlib>
#include <future>
#include <gtest/gtest.h>
#include <memory>
#include <new>
#include <pthread.h>
#include <system_error>
#include <thread>

namespace semrover {
namespace engine_file_queue_test {

using Commit = FileQueue::Commit;

constexpr auto kLong = std::chrono::seconds(20); // for what does not happen

FileQueue::Make file(const Path& path, const std::string& text, std::vector<std::string>& names)
{
    return [path, text, &names]() -> Result<Commit> {
        std::this_thread::sleep_for(std::chrono::microseconds(std::hash<std::string>()(text) % 2000));
        const auto made = std::make_shared<MadeFiles>();
        SR_CHECK(made->add(path, std::as_bytes(std::span(text))));
        return [made, path, &names] {
            names.push_back(path.filename());
            return made->commit();
        };
    };
}

TEST(engine_file_queue, files_appear_in_order_whoever_makes_them)
{
    for (const uint32_t threads : {1u, 2u, 8u}) {
        const ScratchFolder folder;
        std::vector<std::string> names, expected;
        {
            FileQueue queue(threads);
            for (int i = 0; i < 60; ++i) {
                expected.push_back(fmt::format("{:02}", i));
                ASSERT_TRUE(queue.push(1, file(folder / expected.back(), expected.back(), names)));
            }
            ASSERT_TRUE(queue.drain());
            EXPECT_EQ(names, expected);
            ASSERT_TRUE(queue.push(1, file(folder / "last", "last", names)));
        } // after everything
        EXPECT_EQ(contents(folder / "last"), "last");
        for (const std::string& name : expected)
            EXPECT_EQ(contents(folder / name), name);
        EXPECT_EQ(folder.entries(), 61u); // nothing temporary
    }
}

// no thread can be made while one lives: stacks would be too large
class NoThreads {
  public:
    NoThreads()
    {
        EXPECT_EQ(pthread_getattr_default_np(&before_), 0);
        pthread_attr_t huge;
        EXPECT_EQ(pthread_attr_init(&huge), 0);
        EXPECT_EQ(pthread_attr_setstacksize(&huge, size_t(1) << 46), 0);
        EXPECT_EQ(pthread_setattr_default_np(&huge), 0);
        pthread_attr_destroy(&huge);
    }
    ~NoThreads()
    {
        EXPECT_EQ(pthread_setattr_default_np(&before_), 0);
        pthread_attr_destroy(&before_);
    }

  private:
    pthread_attr_t before_;
};

TEST(engine_file_queue, where_no_thread_can_be_made_the_caller_makes_the_files)
{
    const NoThreads none;
    EXPECT_THROW(std::thread([] {}), std::system_error);
    const ScratchFolder folder;
    std::vector<std::string> names, expected;
    {
        FileQueue queue(2);
        for (int i = 0; i < 30; ++i) { // more than may wait
            expected.push_back(fmt::format("{:02}", i));
            ASSERT_TRUE(queue.push(1, file(folder / expected.back(), expected.back(), names)));
        }
        ASSERT_TRUE(queue.drain());
        EXPECT_EQ(names, expected);
        ASSERT_TRUE(queue.push(1, file(folder / "last", "last", names)));
    }
    EXPECT_EQ(contents(folder / "last"), "last");
}

TEST(engine_file_queue, short_memory_in_a_thread_is_an_error_of_the_queue)
{
    const FileQueue::Make good = []() -> Result<Commit> { return Commit([] { return Status(); }); };
    const FileQueue::Make unmade = []() -> Result<Commit> { throw std::bad_alloc(); };
    const FileQueue::Make uncommitted = []() -> Result<Commit> {
        return Commit([]() -> Status { throw std::bad_alloc(); });
    };
    for (const FileQueue::Make& short_of_memory : {unmade, uncommitted}) {
        FileQueue queue(2);
        ASSERT_TRUE(queue.push(1, good));
        (void)queue.push(1, short_of_memory);
        EXPECT_TRUE(says(queue.drain(), "no host memory"));
        EXPECT_TRUE(says(queue.push(1, good), "no host memory"));
    }
}

TEST(engine_file_queue, as_many_are_made_at_a_time_as_there_are_threads)
{
    FileQueue queue(3);
    std::atomic<int> inside = 0;
    std::promise<void> all;
    const std::shared_future<void> here = all.get_future().share();
    for (int i = 0; i < 3; ++i)
        ASSERT_TRUE(queue.push(1, [&, here]() -> Result<Commit> {
            if (++inside == 3)
                all.set_value();
            if (here.wait_for(kLong) != std::future_status::ready)
                return fail(ErrorCode::bad_input, "it is alone");
            return [] { return Status(); };
        }));
    EXPECT_TRUE(queue.drain());
}

TEST(engine_file_queue, after_an_error_nothing_appears_and_nothing_stays)
{
    for (const bool in_commit : {false, true}) {
        const ScratchFolder folder;
        std::vector<std::string> names;
        FileQueue queue(4);
        Status pushed;
        for (int i = 0; i < 40 && pushed; ++i)
            pushed = queue.push(
                1, i != 7 ? file(folder / fmt::format("{:02}", i), "text", names) : [in_commit]() -> Result<Commit> {
                    if (!in_commit)
                        return fail(ErrorCode::bad_input, "no room");
                    return [] { return Status(fail(ErrorCode::bad_input, "no room")); };
                });
        EXPECT_TRUE(says(queue.drain(), "no room"));
        EXPECT_TRUE(says(queue.push(1, file(folder / "late", "late", names)), "no room"));
        EXPECT_TRUE(says(queue.drain(), "no room"));
        EXPECT_EQ(names.size(), 7u);
        EXPECT_EQ(folder.entries(), 7u); // those before it, and no temporary files
    }
}

TEST(engine_file_queue, what_waits_has_a_limit_of_bytes)
{
    FileQueue queue(1);
    std::promise<void> gate;
    const std::shared_future<void> open = gate.get_future().share();
    std::atomic<int> pushed = 0;
    const auto make = [open]() -> Result<Commit> {
        open.wait();
        return [] { return Status(); };
    };
    const auto pusher = std::async(std::launch::async, [&] {
        for (int i = 0; i < 3; ++i, ++pushed)
            ASSERT_TRUE(queue.push(200ull << 20, make));
    });
    EXPECT_EQ(pusher.wait_for(std::chrono::milliseconds(300)), std::future_status::timeout);
    EXPECT_EQ(pushed, 2); // 600 MiB would be too many
    gate.set_value();
    pusher.wait();
    EXPECT_TRUE(queue.drain());
    EXPECT_GT(queue.wait_seconds(), 0.2);
    EXPECT_TRUE(queue.push(1ull << 40, make)); // alone, anything
}

TEST(engine_file_queue, a_task_of_slurm_uses_what_it_was_given)
{
    ::unsetenv("SLURM_CPUS_PER_TASK");
    const uint32_t all = usable_threads();
    EXPECT_GE(all, 1u);
    EXPECT_LE(all, 16u);
    for (const auto& [text, expected] : {std::pair{"1", 1u}, {"100000", all}, {"", all}, {"x", all}}) {
        ::setenv("SLURM_CPUS_PER_TASK", text, 1);
        EXPECT_EQ(usable_threads(), expected) << text;
    }
    ::unsetenv("SLURM_CPUS_PER_TASK");
}

} // namespace engine_file_queue_test
} // namespace semrover
