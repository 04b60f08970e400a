// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
#include "runtime/base/file.h"

#include "runtime/base/final_name.h"
#include "runtime/base/quote.h"
#include "runtime/system/host_name.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <chrono>
#include <csignal>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

namespace semrover {
namespace file_test {

using std::chrono_literals::operator""h;

TEST(File, a_file_reads_back_as_written)
{
    const ScratchFolder folder;
    const std::string text("one\0two\n", 8);
    ASSERT_TRUE(write_file_atomically(folder / "a", text));
    EXPECT_EQ(read_text_file(folder / "a", 100).value(), text);
    EXPECT_EQ(read_file(folder / "a", 8).value().size(), 8u);
    EXPECT_EQ(folder.entries(), 1u);
}

TEST(File, text_begins_after_its_byte_order_mark)
{
    const ScratchFolder folder;
    EXPECT_EQ(read_text_file(folder.put("a", "\xef\xbb\xbfone\xef\xbb\xbf"), 100).value(), "one\xef\xbb\xbf");
    EXPECT_EQ(read_text_file(folder.put("a", "\xef\xbb"), 100).value(), "\xef\xbb");
    EXPECT_EQ(read_file(folder.put("a", "\xef\xbb\xbfone"), 100).value().size(), 6u); // bytes are no text
    for (const auto& [bytes, name] : {std::pair{std::string("\xff\xfeo\0", 4), "UTF-16"},
                                      {std::string("\xfe\xff\0o", 4), "UTF-16"},
                                      {std::string("\xff\xfe\0\0", 4), "UTF-32"},
                                      {std::string("\0\0\xfe\xff", 4), "UTF-32"}})
        EXPECT_TRUE(says(read_text_file(folder.put("a", bytes), 100),
                         fmt::format("a': starts as text in {} does, expected UTF-8", name)));
}

TEST(File, what_cannot_be_read_says_why)
{
    const ScratchFolder folder;
    folder.put("long", "12345");
    EXPECT_TRUE(says(read_file(folder / "none", 10), "No such file"));
    EXPECT_TRUE(says(read_file(folder.path(), 10), "found a folder"));
    EXPECT_TRUE(says(read_file(folder / "long", 4), "expected at most 4 bytes, found 5"));
    EXPECT_TRUE(says(read_file("/dev/zero", 10), "a device or pipe"));
    EXPECT_EQ(read_file(folder / "none", 10).error().code, ErrorCode::bad_input);
}

TEST(File, a_pipe_without_a_writer_is_refused_at_once)
{
    const ScratchFolder folder;
    ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_TRUE(says(read_file(folder / "pipe", 10), "a device or pipe"));
    EXPECT_TRUE(says(MappedFile::open(folder / "pipe"), "a device or pipe"));
}

TEST(File, a_file_without_permission_is_refused)
{
    if (geteuid() == 0)
        GTEST_SKIP() << "root reads everything";
    const ScratchFolder folder;
    chmod(folder.put("secret", "x").c_str(), 0);
    EXPECT_TRUE(says(read_file(folder / "secret", 10), "Permission denied"));
}

TEST(File, what_cannot_be_examined_counts_as_there)
{
    const ScratchFolder folder;
    std::filesystem::create_symlink("loop", folder / "loop");
    EXPECT_TRUE(is_there(folder / "loop") && is_file(folder / "loop") && is_folder(folder / "loop"));
    EXPECT_FALSE(is_there(folder / "absent") || is_file(folder / std::string(300, 'x')));
    const Status refused = refuse_existing(folder / "loop", false);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::bad_input);
    EXPECT_NE(refused.error().message.find("cannot examine"), std::string::npos) << refused.error().message;
    EXPECT_TRUE(refuse_existing(folder / "absent", false) && refuse_existing(folder / "loop", true));
}

TEST(AtomicFile, an_existing_file_is_replaced_whole)
{
    const ScratchFolder folder;
    folder.put("a", "old and longer");
    ASSERT_TRUE(write_file_atomically(folder / "a", "new"));
    EXPECT_EQ(contents(folder / "a"), "new");
}

TEST(AtomicFile, without_commit_nothing_is_left_and_the_old_bytes_stay)
{
    const ScratchFolder folder;
    folder.put("a", "old");
    {
        auto file = AtomicFile::create(folder / "a");
        ASSERT_TRUE(file);
        ASSERT_TRUE(file->write("half"));
        EXPECT_EQ(folder.entries(), 2u);
        AtomicFile moved = std::move(*file);
        ASSERT_TRUE(moved.write(" more"));
    }
    EXPECT_EQ(contents(folder / "a"), "old");
    EXPECT_EQ(folder.entries(), 1u);
}

TEST(AtomicFile, a_failing_write_leaves_nothing)
{
    const ScratchFolder folder;
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const rlimit small{4096, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    const Status status = write_file_atomically(folder / "big", std::string(10000, 'x'));
    setrlimit(RLIMIT_FSIZE, &before);
    EXPECT_TRUE(says(status, "File too large"));
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(AtomicFile, a_place_that_cannot_hold_a_file_is_refused_before_anything_is_written)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(AtomicFile::create(folder.path()), "it is a folder"));
    EXPECT_TRUE(says(AtomicFile::create(folder / "no" / "file"), "No such file"));
    EXPECT_TRUE(says(AtomicFile::create(folder / ""), "it names no file"));
    EXPECT_TRUE(says(AtomicFile::create("/dev/full"), "a device"));
}

TEST(AtomicFile, what_a_killed_process_left_can_be_swept_away)
{
    ScratchFolder folder;
    std::filesystem::create_directories(folder / "a" / "b");
    const std::string host = host_name(), us = unfinished_name(), parent = std::to_string(::getppid());
    EXPECT_TRUE(us.starts_with(fmt::format(".semrover-{}-{}-", host, ::getpid()))) << us;
    EXPECT_NE(us, unfinished_name());
    // 2147483647 is above any number that Linux gives a process
    const std::vector<std::string> gone = {"a/.semrover-" + host + "-2147483647-0.tmp",
                                           "a/b/.semrover-" + host + "-2147483647-1.tmp"};
    const std::vector<std::string> old = {"a/.semrover-elsewhere-17-0.tmp", "a/.semrover-17-1.tmp"};
    const std::vector<std::string> kept = {"a/b/whole.tmp",
                                           "a/.semrover-x",
                                           "a/" + us,
                                           "a/.semrover-" + host + "-" + parent + "-0.tmp",
                                           "a/.semrover-" + host + "-2147483647.tmp",
                                           "a/.semrover-" + host + "-2-2147483647-0.tmp", // another host
                                           "a/.semrover-elsewhere-2147483647-0.tmp",
                                           ".semrover-" + host + "-2147483647-2.tmp"};
    for (const auto& names : {gone, old, kept})
        for (const std::string& name : names)
            folder.put(name, "half");
    for (const std::string& name : old)
        std::filesystem::last_write_time(folder / name, std::filesystem::file_time_type::clock::now() - 25h);
    remove_temporary_files(folder / "a");
    remove_temporary_files(folder / "missing");
    for (const std::string& name : kept)
        EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
    for (const auto& names : {gone, old})
        for (const std::string& name : names)
            EXPECT_FALSE(std::filesystem::exists(folder / name)) << name;
}

TEST(AtomicFile, a_name_of_255_bytes_works)
{
    const ScratchFolder folder;
    EXPECT_TRUE(write_file_atomically(folder / std::string(255, 'n'), "x"));
    const Status too_long = write_file_atomically(folder / std::string(256, 'n'), "x");
    EXPECT_TRUE(says(too_long, "name too long"));
    EXPECT_EQ(folder.entries(), 1u);
}

TEST(MappedFile, the_bytes_are_those_of_the_file)
{
    const ScratchFolder folder;
    auto mapped = MappedFile::open(folder.put("a", "hello"));
    ASSERT_TRUE(mapped);
    const MappedFile moved = std::move(*mapped);
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(moved.bytes().data()), moved.bytes().size()), "hello");
    EXPECT_TRUE(mapped->bytes().empty());
}

TEST(MappedFile, an_empty_file_has_no_bytes)
{
    const ScratchFolder folder;
    EXPECT_TRUE(MappedFile::open(folder.put("empty", "")).value().bytes().empty());
}

TEST(MappedFile, replacing_the_file_does_not_disturb_its_map)
{
    const ScratchFolder folder;
    const MappedFile mapped = MappedFile::open(folder.put("a", "first")).value();
    ASSERT_TRUE(write_file_atomically(folder / "a", "other"));
    EXPECT_EQ(std::to_integer<char>(mapped.bytes()[0]), 'f');
}

TEST(Quote, controls_and_broken_utf8_are_escaped_and_long_text_is_cut)
{
    EXPECT_EQ(quote("gr\xc3\xbc\xc3\x9f"), "'gr\xc3\xbc\xc3\x9f'");
    EXPECT_EQ(printable("a\x1b[31m\n\xff\xc2\x9b"), "a\\x1b[31m\\x0a\\xff\\xc2\\x9b");
    EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");
    EXPECT_EQ(printable("abcdef", 4), "abcd...");
    EXPECT_EQ(printable("ab\xc3\xbc", 3), "ab...");
}

} // namespace file_test
} // namespace semrover
