// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/shards/shard_set.h"

#include <functional>

namespace semrover {

struct ShardFault {
    std::string path; // of a picture or file in the folder, or the name of an archive
    std::string what;
};

// All that is wrong with a set: bytes whose hash is another, headers that are not those of the index, bytes between and
// behind members that are not 0, files beside the archives that are missing or changed, and pictures that are missing:
// a kind that a camera has at other moments between its first and last, or moments that no camera has. Errors: what
// `progress` returns
Result<std::vector<ShardFault>> check_shards(const ShardSet& set,
                                             const std::function<Status(uint64_t bytes, uint64_t total)>& progress);

} // namespace semrover
