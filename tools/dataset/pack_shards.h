// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/shards/shard_index.h"

#include <functional>

namespace semrover {

struct ShardOptions {
    std::string key_prefix = {};         // in front of each moment's number: "SCENE_DRIVE_"
    uint64_t shard_bytes = 512ull << 20; // an archive ends before it has more, unless one moment alone has
    bool replace = false;                // a set that is there
    std::vector<std::string> skip = {};  // files and folders directly in the folder that are left out
    std::function<Status(uint64_t bytes, uint64_t total)> progress = {}; // an error of it ends the work
};

struct ShardSetInfo {
    uint64_t moments = 0, pictures = 0, shards = 0;
    uint64_t bytes = 0; // of all archives
    uint64_t files = 0; // beside them
};

// Packs a folder of pictures (shard_picture()) into a shard set at `output`, with its other files beside the archives.
// Equal pictures and options give equal bytes. One picture is open at a time; the index comes last, so that a folder
// in which this was stopped is no set and is packed anew. Memory: some 200 bytes a file.
// Errors: usage for a set that is there, for other files in `output`, for one folder inside the other, for a key_prefix
// that is none; bad_input for no pictures, more than 2^20 files, names that an archive does not hold, devices, links to
// folders and links to nothing
Result<ShardSetInfo> pack_shards(const Path& folder, const Path& output, const ShardOptions& options = {});

} // namespace semrover
