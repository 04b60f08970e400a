// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/check_shards.h"

#include "engine/shards/ustar.h"
#include "runtime/base/hash.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

using Bytes = std::span<const std::byte>;

uint64_t hash_of(Bytes bytes)
{
    Hash hash;
    hash.add(bytes);
    return hash.value();
}

bool are_zero(Bytes bytes)
{
    return std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte(0); });
}

// pictures that have the same path but for their number
struct Slot {
    std::string folder, group, ending;
    bool operator<(const Slot& o) const
    {
        return std::tie(group, folder, ending) < std::tie(o.group, o.folder, o.ending);
    }
};

// from the first moment of a camera to its last, all of its kinds are there
class MissingPictures {
  public:
    explicit MissingPictures(const ShardIndex& index) : index_(index)
    {
        each([&](uint32_t moment, const Slot& slot) {
            slots_.insert(slot);
            const auto [range, fresh] = ranges_.try_emplace(slot.group, moment, moment);
            range->second.second = moment;
        });
    }

    void find(std::vector<ShardFault>& faults)
    {
        std::optional<uint32_t> current;
        std::set<Slot> here;
        const auto end_moment = [&] {
            for (const Slot& slot : slots_)
                if (const auto [first, last] = ranges_.at(slot.group);
                    current && *current >= first && *current <= last && !here.contains(slot))
                    faults.push_back({fmt::format("{}/{:06}.{}", slot.folder, *current, slot.ending), "is missing"});
            here.clear();
        };
        each([&](uint32_t moment, const Slot& slot) {
            if (current != moment)
                end_moment();
            if (current && moment > *current + 1)
                faults.push_back({fmt::format("{:06} to {:06}", *current + 1, moment - 1), "no pictures"});
            current = moment;
            here.insert(slot);
        });
        end_moment();
    }

  private:
    template <typename Visit>
    void each(Visit visit) const
    {
        for (const Shard& shard : index_.shards)
            for (const ShardMember& member : shard.members) {
                const ShardPicture name = *shard_picture(member.path);
                visit(name.moment, Slot{Path(member.path).parent_path().generic_string(), name.group, name.ending});
            }
    }

    const ShardIndex& index_;
    std::set<Slot> slots_;
    std::map<std::string, std::pair<uint32_t, uint32_t>> ranges_; // of groups
};

void check_member(const ShardSet& set, size_t shard, const ShardMember& m, std::vector<ShardFault>& faults)
{
    const Bytes archive = set.archive(shard);
    const TarHeader header = tar_header(member_name(set.index().key_prefix, *shard_picture(m.path)), m.size);
    if (!std::ranges::equal(archive.subspan(m.offset - kTarBlock, kTarBlock), std::as_bytes(std::span(header))))
        faults.push_back({m.path, fmt::format("its header in {} is not that of the index", shard_name(shard))});
    if (hash_of(set.bytes(shard, m)) != m.hash)
        faults.push_back({m.path, fmt::format("its bytes in {} have another hash", shard_name(shard))});
    if (!are_zero(archive.subspan(m.offset + m.size, tar_padded(m.size) - m.size)))
        faults.push_back({m.path, fmt::format("what follows it in {} is not 0", shard_name(shard))});
}

void check_file(const Path& folder, const ShardMember& m, std::vector<ShardFault>& faults)
{
    const auto file = MappedFile::open(folder / m.path);
    if (!file)
        faults.push_back({m.path, "is missing, or cannot be read"});
    else if (file->bytes().size() != m.size || hash_of(file->bytes()) != m.hash)
        faults.push_back({m.path, "has another size or hash"});
}

} // namespace

Result<std::vector<ShardFault>> check_shards(const ShardSet& set,
                                             const std::function<Status(uint64_t bytes, uint64_t total)>& progress)
{
    const ShardIndex& index = set.index();
    std::vector<ShardFault> faults;
    uint64_t total = 0, done = 0;
    for (const Shard& shard : index.shards)
        total += shard.bytes;
    for (size_t i = 0; i < index.shards.size(); ++i) {
        for (const ShardMember& member : index.shards[i].members) {
            check_member(set, i, member, faults);
            done += kTarBlock + tar_padded(member.size);
            SR_CHECK(progress(done, total));
        }
        if (!are_zero(set.archive(i).last(kTarEnd)))
            faults.push_back({shard_name(i), "its end is not 0"});
        done += kTarEnd;
    }
    for (const ShardMember& file : index.files)
        check_file(set.folder(), file, faults);
    MissingPictures(index).find(faults);
    return faults;
}

} // namespace semrover
