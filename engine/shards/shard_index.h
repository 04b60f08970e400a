// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <optional>

namespace semrover {

// A shard set (docs/formats.md): the pictures of a folder in archives frames-00000.tar, .., an index.json of them, and
// the folder's other files as they were.
constexpr const char* kShardIndexName = "index.json";
constexpr std::string_view kShardFormat = "semrover.shards"; // in its first line
constexpr size_t kMostShardFiles = size_t(1) << 20;          // of a set
constexpr size_t kMostShards = 100000;

std::string shard_name(size_t number); // "frames-00012.tar"
bool is_shard_name(std::string_view name);

// What a picture's path in its folder says: [buffers/][CAMERA/]KIND/NNNNNN.ENDING, or
// [buffers/]{frames,latents}/[CAMERA/]NNNNNN.ENDING, whose kind is `frame` or `latent`. KIND has no point
struct ShardPicture {
    uint32_t moment = 0; // the number of its frame
    std::string group;   // the folder around it without its kind: "", "front", "frames", "frames/front"
    std::string camera, kind, ending;
};
std::optional<ShardPicture> shard_picture(std::string_view path); // none: it is no picture

bool is_key_prefix(std::string_view prefix); // up to 48 letters, digits, '_' and '-'

// the name in an archive: "SCENE_DRIVE_000012.front.color.png"
std::string member_name(std::string_view key_prefix, const ShardPicture& picture);

struct ShardMember {
    std::string path;              // in the folder
    uint64_t offset = 0, size = 0; // of its bytes in the archive
    uint64_t hash = 0;             // hash.h, of its bytes as one piece
};

struct Shard {
    uint64_t bytes = 0; // of the archive
    std::vector<ShardMember> members;
};

struct ShardIndex {
    std::string key_prefix;
    std::vector<Shard> shards;
    std::vector<ShardMember> files; // beside the archives; their offsets are 0
};

Status write_shard_index(const Path& folder, const ShardIndex& index); // atomically

// Members are in order of moment and name, fill their archives without gaps, and no moment is in two of them.
// bad_input: the index is missing, longer than 256 MiB or of more than 2^20 files, or says anything else
Result<ShardIndex> read_shard_index(const Path& folder);

} // namespace semrover
