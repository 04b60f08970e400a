// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/shards/shard_index.h"
#include "runtime/base/memory_files.h"

namespace semrover {

// A shard set whose archives are mapped. As long as it lives, what reads files (file.h) finds the pictures in its
// folder at the paths that they had: SET/front/color/000012.png. Its headers and hashes are not looked at. Threads:
// sets of one folder are opened and closed by one; their files are read by any.
class ShardSet {
  public:
    // bad_input as read_shard_index(), and for an archive that is missing or has another size than the index says
    static Result<std::shared_ptr<const ShardSet>> open(const Path& folder);

    const Path& folder() const { return folder_.path(); }
    const ShardIndex& index() const { return index_; }
    std::span<const std::byte> archive(size_t shard) const { return archives_[shard].bytes(); }
    std::span<const std::byte> bytes(size_t shard, const ShardMember& member) const
    {
        return archive(shard).subspan(member.offset, member.size);
    }

    ShardSet(const Path& folder, ShardIndex index) : index_(std::move(index)), folder_(folder) {}

  private:
    ShardIndex index_;
    std::vector<MappedFile> archives_;
    MemoryFolder folder_;
};

// What lets readers of a folder of pictures take a shard set in its place: the set that `folder` is, or lies up to
// three folders deep in (SET/front/color). Null: there is none. Errors: bad_input as open(), and for archives without
// an index
using ShardsOrNone = std::shared_ptr<const ShardSet>;
Result<ShardsOrNone> open_if_shards(const Path& folder);

} // namespace semrover
