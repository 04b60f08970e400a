// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/shards/shard_set.h"

#include "runtime/base/quote.h"

#include <mutex>

namespace semrover {

namespace {

// those that are open, so that two readers of one set share it
struct OpenSets {
    std::mutex mutex;
    std::map<Path, std::weak_ptr<const ShardSet>> sets;
};
OpenSets& open_sets()
{
    static OpenSets all;
    return all;
}

// whatever way a path is written
Path key_path(const Path& folder)
{
    std::error_code ignored;
    const Path whole = std::filesystem::absolute(folder, ignored).lexically_normal();
    return whole.has_filename() ? whole : whole.parent_path(); // "set/"
}

// whether a folder's index.json is one of ours, whatever else is wrong with it
bool has_shard_index(const Path& folder)
{
    constexpr size_t kStart = 256;
    const auto file = MappedFile::open(folder / kShardIndexName);
    if (!file)
        return false;
    const auto bytes = file->bytes().first(std::min(file->bytes().size(), kStart));
    return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()).find(kShardFormat) !=
           std::string_view::npos;
}

} // namespace

Result<std::shared_ptr<const ShardSet>> ShardSet::open(const Path& folder)
{
    OpenSets& all = open_sets();
    const std::lock_guard guard(all.mutex);
    std::erase_if(all.sets, [](const auto& entry) { return entry.second.expired(); });
    const Path key = key_path(folder);
    if (const auto known = all.sets.find(key); known != all.sets.end())
        if (std::shared_ptr<const ShardSet> set = known->second.lock())
            return set;
    SR_TRY(ShardIndex index, read_shard_index(folder));
    const auto set = std::make_shared<ShardSet>(folder, std::move(index));
    for (size_t i = 0; i < set->index_.shards.size(); ++i) {
        const Shard& shard = set->index_.shards[i];
        SR_TRY(MappedFile file, MappedFile::open(folder / shard_name(i)));
        if (file.bytes().size() != shard.bytes)
            return fail(ErrorCode::bad_input, "{} has {} bytes, its index says {}", quote_path(folder / shard_name(i)),
                        file.bytes().size(), shard.bytes);
        set->archives_.push_back(std::move(file));
        for (const ShardMember& member : shard.members)
            SR_CHECK(set->folder_.add(member.path, set->bytes(i, member)));
    }
    all.sets[key] = set;
    return std::shared_ptr<const ShardSet>(set);
}

Result<ShardsOrNone> open_if_shards(const Path& folder)
{
    constexpr int kMostBelow = 3; // buffers/front/color
    Path at = key_path(folder);
    for (int below = 0; below <= kMostBelow; ++below, at = at.parent_path())
        if (has_shard_index(at))
            return ShardSet::open(at);
    if (!is_file(folder / shard_name(0)))
        return ShardsOrNone();
    if (is_file(folder / kShardIndexName))
        return ShardSet::open(folder); // to say what is wrong with it
    return fail(ErrorCode::bad_input, "{} holds archives without {}: what packed them did not come to its end",
                quote_path(folder), kShardIndexName);
}

} // namespace semrover
