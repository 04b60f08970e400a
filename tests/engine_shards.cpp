// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
#include "engine/shards/ustar.h"
#include "runtime/base/hash.h"
#include "runtime/base/json.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/dataset/check_shards.h"
#include "tools/dataset/pack_shards.h"

#include <fstream>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_shards_test {

namespace fs = std::filesystem;

std::vector<Path> tree(const Path& folder)
{
    return list_tree(folder).value();
}

// a folder `in` as a rig's drive leaves it: two cameras, one of which sees a moment less, and refined frames
class Shards : public testing::Test {
  protected:
    Shards()
    {
        for (uint32_t moment = 0; moment < 5; ++moment)
            for (const char* folder : {"front/color", "front/depth", "left.up/color", "frames/front"})
                if (moment < 4 || std::string(folder) != "left.up/color")
                    put(fmt::format("in/{}/{:06}.png", folder, moment), random_text());
        put("in/front/depth/000002.png", ""); // a member without bytes
        put("in/front/depth/000003.png", std::string(512, 'x'));
        put("in/transforms.json", "{}");
        put("in/more/\xc3\xa4 b.txt", "text");
    }

    std::string random_text()
    {
        std::string text(random_() % 700, '\0');
        for (char& c : text)
            c = char(random_());
        return text;
    }
    void put(const std::string& name, std::string_view text) const
    {
        fs::create_directories((folder_ / name).parent_path());
        folder_.put(name, text);
    }
    Result<ShardSetInfo> pack(std::string_view set = "set", const ShardOptions& options = {}) const
    {
        return pack_shards(folder_ / "in", folder_ / set, options);
    }
    // what opening a set, or else a look at all of it, says is wrong
    std::vector<std::string> faults() const
    {
        const auto set = ShardSet::open(folder_ / "set");
        if (!set)
            return {set.error().message};
        std::vector<std::string> texts;
        const auto found = check_shards(**set, [](uint64_t, uint64_t) { return Status{}; });
        for (const ShardFault& fault : *found)
            texts.push_back(fault.path + ": " + fault.what);
        return texts;
    }
    void expect_faults(std::initializer_list<std::string> texts) const
    {
        EXPECT_EQ(faults(), std::vector<std::string>(texts));
    }
    Path index() const { return folder_ / "set" / kShardIndexName; }
    // the set is refused where this stands for that in its index
    void expect_refusal(const std::string& from, const std::string& to, std::string_view text) const
    {
        const std::string before = contents(index());
        std::string after = before;
        ASSERT_NE(before.find(from), std::string::npos) << from;
        folder_.put("set/index.json", after.replace(before.find(from), from.size(), to));
        EXPECT_TRUE(says(ShardSet::open(folder_ / "set"), text)) << to;
        folder_.put("set/index.json", before);
    }

    ScratchFolder folder_;
    std::mt19937 random_{7};
};

std::vector<std::string> names(const Result<std::vector<Path>>& paths)
{
    std::vector<std::string> names;
    for (const Path& path : paths.value())
        names.push_back(path.filename().string());
    return names;
}

TEST_F(Shards, a_set_is_read_as_the_folder_it_was)
{
    const auto info = pack();
    ASSERT_TRUE(info) << info.error().message;
    EXPECT_EQ(info->moments, 5u);
    EXPECT_EQ(info->pictures, 19u);
    EXPECT_EQ(info->files, 2u);
    EXPECT_EQ(info->bytes, fs::file_size(folder_ / "set/frames-00000.tar"));
    const Path in = folder_ / "in", set = folder_ / "set";
    EXPECT_FALSE(is_there(set / "front"));
    {
        const auto shards = open_if_shards(set / "front/color"); // a folder in it means the whole
        ASSERT_TRUE(shards && *shards);
        EXPECT_EQ(open_if_shards(set.string() + "/")->get(), shards->get());
        for (const Path& path : tree(in)) {
            const Path same = set / path.lexically_relative(in);
            EXPECT_EQ(read_file(same, 1 << 20).value(), read_file(path, 1 << 20).value()) << same;
            EXPECT_EQ(hash_file(same).value(), hash_file(path).value()) << same;
        }
        EXPECT_TRUE(is_folder(set / "front"));
        EXPECT_TRUE(is_file(set / "front/color/../color/000001.png"));
        EXPECT_FALSE(is_there(set / "left.up/color/000004.png"));
        EXPECT_EQ(names(list_folders(set)), (std::vector<std::string>{"frames", "front", "left.up", "more"}));
        EXPECT_EQ(names(list_files(set)),
                  (std::vector<std::string>{"frames-00000.tar", "index.json", "transforms.json"}));
        EXPECT_EQ(names(list_files(set / "left.up/color")), names(list_files(in / "left.up/color")));
        EXPECT_EQ(tree(set).size(), 19u + 4u);
    }
    EXPECT_FALSE(is_there(set / "front"));
    put("set/front/notes.txt", "a folder of the disk in it means the whole, too");
    EXPECT_NE(open_if_shards(set / "front/color")->get(), nullptr);
    EXPECT_EQ(open_if_shards(in)->get(), nullptr);
    EXPECT_EQ(open_if_shards(folder_ / "none/at/all")->get(), nullptr);
}

TEST_F(Shards, equal_folders_give_equal_bytes_and_no_moment_is_in_two_archives)
{
    const ShardOptions small{.key_prefix = "S1_D-2_", .shard_bytes = 5000};
    const auto info = pack("a", small);
    ASSERT_TRUE(info) << info.error().message;
    fs::rename(folder_ / "in", folder_ / "other");
    fs::copy(folder_ / "other", folder_ / "in", fs::copy_options::recursive);
    ASSERT_TRUE(pack("b", small));
    EXPECT_GT(info->shards, 1u);
    std::set<uint32_t> before;
    const ShardIndex index = *read_shard_index(folder_ / "a");
    for (size_t i = 0; i < index.shards.size(); ++i) {
        std::set<uint32_t> moments;
        for (const ShardMember& member : index.shards[i].members)
            moments.insert(shard_picture(member.path)->moment);
        for (const uint32_t moment : moments)
            EXPECT_TRUE(before.insert(moment).second) << moment;
        EXPECT_TRUE(index.shards[i].bytes <= small.shard_bytes || moments.size() == 1);
        EXPECT_EQ(contents(folder_ / "a" / shard_name(i)), contents(folder_ / "b" / shard_name(i)));
    }
    EXPECT_EQ(contents(folder_ / "a/index.json"), contents(folder_ / "b/index.json"));
    ASSERT_TRUE(pack("c", {.shard_bytes = 1})); // each moment is more than that
    EXPECT_EQ(read_shard_index(folder_ / "c")->shards.size(), 5u);
}

TEST_F(Shards, any_byte_that_changes_is_found)
{
#ifdef __SANITIZE_ADDRESS__
    constexpr size_t kStep = 7; // each byte takes a minute there
#else
    constexpr size_t kStep = 1;
#endif
    ASSERT_TRUE(pack("set", {.key_prefix = "D_", .shard_bytes = 9000}));
    expect_faults({});
    for (const Path& file : tree(folder_ / "set")) {
        const std::string bytes = contents(file);
        for (size_t at = 0; at < bytes.size(); at += kStep) {
            std::fstream(file, std::ios::in | std::ios::out | std::ios::binary)
                .seekp(std::streamoff(at))
                .put(char(bytes[at] ^ (1 << at % 7)));
            EXPECT_FALSE(faults().empty()) << file << " byte " << at;
            std::fstream(file, std::ios::in | std::ios::out | std::ios::binary)
                .seekp(std::streamoff(at))
                .put(bytes[at]);
        }
    }
    expect_faults({});
}

TEST_F(Shards, a_file_that_is_cut_is_refused_or_found)
{
    ASSERT_TRUE(pack("set", {.shard_bytes = 9000}));
    for (const Path& file : tree(folder_ / "set")) {
        const std::string bytes = contents(file);
        for (size_t length = 0; length < bytes.size() - 1; length += 37) { // the last is the index's end of line
            std::ofstream(file, std::ios::binary) << bytes.substr(0, length);
            EXPECT_FALSE(faults().empty()) << file << " of " << length;
        }
        std::ofstream(file, std::ios::binary) << bytes;
    }
    expect_faults({});
    fs::remove(folder_ / "set/frames-00001.tar");
    EXPECT_TRUE(says(ShardSet::open(folder_ / "set"), "frames-00001.tar': No such file"));
}

TEST_F(Shards, an_index_that_lies_is_refused)
{
    ASSERT_TRUE(pack());
    const Shard shard = read_shard_index(folder_ / "set")->shards[0];
    const auto number = [](uint64_t n) { return fmt::format(" {},", n); };
    const std::string second = number(shard.members[1].offset);
    expect_refusal(second, number(shard.members[1].offset - 512), "expected"); // over the one before
    expect_refusal(second, number(shard.members[1].offset + 1), "a block behind the one before");
    expect_refusal(second, number(~uint64_t(0)), "has the offset 18446744073709551615");
    expect_refusal(second, " -1,", "expected a whole number of bytes");
    const std::string last = fmt::format("{}, {},", shard.members.back().offset, shard.members.back().size);
    expect_refusal(last, fmt::format("{}, {},", shard.members.back().offset, uint64_t(1) << 32), "the archive has");
    expect_refusal(last, fmt::format("{}, {},", shard.members.back().offset, ~uint64_t(0)), "more than an archive");
    const std::string bytes = fmt::format("\"bytes\": {}", shard.bytes);
    expect_refusal(bytes, fmt::format("\"bytes\": {}", shard.bytes + 512), "expected 1024 more for its end");
    expect_refusal(bytes, "\"bytes\": 18446744073709551104", "expected 1024 more for its end");
    expect_refusal("front/color/000000.png", "../color/000000.png", "expected a path");
    expect_refusal("front/color/000000.png", "/front/color/000000.png", "expected a path");
    expect_refusal("front/color/000000.png", "front/color/000001.png", "expected members in order");
    expect_refusal("\"transforms.json\"", "\"../transforms.json\"", "the path of another file inside");
    expect_refusal("\"transforms.json\"", "\"more/../../x\"", "the path of another file inside");
    expect_refusal("\"transforms.json\"", "\"/etc/passwd\"", "the path of another file inside");
    expect_refusal("frames-00000.tar", "frames-00001.tar", "expected this name");
    expect_refusal("\"version\": 1", "\"version\": 2", "expected a semrover.shards of version 1");
    expect_refusal("\"key_prefix\": \"\"", "\"key_prefix\": \"a.b\"", "expected letters");
    expect_refusal("\"shards\": [", "\"shards\": [7, ", "expected an object");
    expect_refusal("\"files\": [", "\"files\": [[], ", "expected a list of path");
    std::string many = "\"files\": [";
    for (size_t i = 0; i < kMostShardFiles; ++i)
        many += fmt::format("[\"{:07}\", 0, \"0000000000000000\"], ", i);
    expect_refusal("\"files\": [", many, "expected at most 1048576 files");
    fs::resize_file(index(), 300 << 20);
    EXPECT_TRUE(says(ShardSet::open(folder_ / "set"), "expected at most 268435456 bytes"));
}

TEST_F(Shards, pictures_that_others_have_are_missed)
{
    fs::remove(folder_ / "in/front/depth/000001.png");
    fs::remove(folder_ / "in/front/depth/000004.png");  // its colour is there
    fs::remove(folder_ / "in/frames/front/000004.png"); // a run of fewer frames
    for (const char* folder : {"front/color", "front/depth", "left.up/color", "frames/front"})
        fs::remove(folder_ / "in" / folder / "000002.png");
    ASSERT_TRUE(pack());
    expect_faults(
        {"front/depth/000001.png: is missing", "000002 to 000002: no pictures", "front/depth/000004.png: is missing"});
}

TEST(ShardPictures, are_known_by_their_paths)
{
    const auto name = [](std::string_view path) {
        const auto picture = shard_picture(path);
        return picture ? member_name("", *picture) + " " + picture->group : "";
    };
    EXPECT_EQ(name("color/000012.png"), "000012.color.png ");
    EXPECT_EQ(name("front/depth_median/1234567.npy"), "1234567.front.depth_median.npy front");
    EXPECT_EQ(name("frames/000012.jpg"), "000012.frame.jpg frames");
    EXPECT_EQ(name("latents/front/000012.safetensors"), "000012.front.latent.safetensors latents/front");
    EXPECT_EQ(name("buffers/color/000012.png"), "000012.color.png buffers");
    EXPECT_EQ(name("buffers/front/color/000012.png"), "000012.front.color.png buffers/front");
    EXPECT_EQ(name("shifted/color/000012.png"), "000012.shifted.color.png shifted");
    for (const char* other :
         {"000012.png", "color/12.png", "color/0000012.png", "color/000012", "color/000012.a.b", "color/000012.",
          "color/x00012.png", "color/-00012.png", "a/b/color/000012.png", "front.color/000012.png",
          "frames/a/b/000012.png", ".hidden/000012.png", "a//000012.png", "../000012.png", "/color/000012.png",
          "color/4294967296.png", "caf\xc3\xa9/000012.png", ""})
        EXPECT_EQ(name(other), "") << other;
}

TEST_F(Shards, what_was_not_finished_is_no_set_and_is_packed_again)
{
    ASSERT_TRUE(pack("set", {.shard_bytes = 6000}));
    EXPECT_TRUE(says(pack(), "index.json' exists; `replace` replaces it"));
    fs::remove(index());
    folder_.put("set/.semrover-1-1.tmp", "half");
    EXPECT_TRUE(says(open_if_shards(folder_ / "set"), "holds archives without index.json"));
    EXPECT_EQ(open_if_shards(folder_ / "set/front")->get(), nullptr); // nothing that is beside an archive
    put("set/index.json", "");
    EXPECT_TRUE(says(open_if_shards(folder_ / "set"), "index.json"));
    fs::remove(index());
    ASSERT_TRUE(pack());
    expect_faults({});
    EXPECT_EQ(tree(folder_ / "set").size(), 4u); // one archive, its index, two other files
    fs::remove(folder_ / "in/transforms.json");
    ASSERT_TRUE(pack("set", {.shard_bytes = 6000, .replace = true}));
    EXPECT_FALSE(is_there(folder_ / "set/transforms.json"));
    fs::remove(index());
    uint32_t calls = 0;
    const auto stop = [&](uint64_t, uint64_t) -> Status {
        return ++calls < 9 ? Status{} : fail(ErrorCode::interrupted, "stop");
    };
    EXPECT_TRUE(says(pack("set", {.progress = stop}), "stop"));
    EXPECT_FALSE(is_there(index()));
    EXPECT_EQ(tree(folder_ / "set").size(), 0u);
}

TEST_F(Shards, folders_that_make_no_set_are_refused)
{
    EXPECT_TRUE(says(pack("in"), "neither is in the other"));
    EXPECT_TRUE(says(pack("in/set"), "neither is in the other"));
    EXPECT_TRUE(says(pack(""), "neither is in the other"));
    EXPECT_TRUE(says(pack("set", {.key_prefix = "a.b"}), "`key` is 'a.b'"));
    EXPECT_TRUE(says(pack_shards(folder_ / "in/more", folder_ / "set"), "holds no pictures"));
    EXPECT_TRUE(says(pack_shards(folder_ / "none", folder_ / "set"), "expected a folder"));
    put("set/notes.txt", "mine");
    EXPECT_TRUE(says(pack("set", {.replace = true}), "notes.txt' is not of the set"));
    const auto expect = [&](const std::string& name, std::string_view text) {
        put(name, "x");
        EXPECT_TRUE(says(pack("other"), text)) << name;
        fs::remove(folder_ / name);
    };
    expect("in/index.json", "none of a set's own");
    expect("in/a\nb", "expected a printable name");
    expect("in/front/frame/000000.png", "would both be '000000.front.frame.png'");
    const std::string camera(64, 'c'), kind(40, 'k');
    expect("in/" + camera + "/" + kind + "/000000.png", kind);
    fs::create_directory_symlink(folder_ / "set", folder_ / "in/link");
    EXPECT_TRUE(says(pack("other"), "found a link"));
    fs::remove(folder_ / "in/link");
    ASSERT_TRUE(pack("other"));
    EXPECT_TRUE(says(pack_shards(folder_ / "other", folder_ / "again"), "is a shard set"));
}

} // namespace engine_shards_test
} // namespace semrover
