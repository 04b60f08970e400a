// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/splat_pool.h"

#include "runtime/device/command.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kBlock = SplatScene::kBlock;

uint32_t blocks_of(uint32_t count)
{
    return round_up(count, kBlock);
}

} // namespace

void SplatPool::Changes::make_room(const Changes& more)
{
    shown.reserve(shown.size() + more.shown.size());
    hidden.reserve(hidden.size() + more.hidden.size());
}

void SplatPool::Changes::take(Changes& from)
{
    make_room(from);
    shown.insert(shown.end(), from.shown.begin(), from.shown.end());
    hidden.insert(hidden.end(), from.hidden.begin(), from.hidden.end());
    from.shown.clear();
    from.hidden.clear();
}

Result<std::unique_ptr<SplatPool>> SplatPool::create(Device& device, uint64_t bytes)
{
    const uint64_t rows = bytes / kSplatBytes;
    const uint64_t most = std::min(device.limits().max_storage_range, device.limits().max_allocation) / 16;
    if (rows < 1 || rows > most)
        return fail(ErrorCode::usage, "splats of {} bytes: expected {} to {}, as much as this device can bind", bytes,
                    kSplatBytes, most * kSplatBytes);
    SR_TRY(SplatScene scene, SplatScene::reserve(device, blocks_of(uint32_t(rows)), true));
    std::unique_ptr<SplatPool> pool(new SplatPool(device, std::move(scene)));
    SR_TRY(pool->commands_, CommandRing::create(device));
    return pool;
}

// the first place for rows between those that are used
std::optional<uint32_t> SplatPool::gap(uint32_t rows, const std::map<uint32_t, uint32_t>& used) const
{
    uint32_t first = 0;
    for (const auto& [begin, end] : used) {
        if (begin - first >= rows)
            break;
        first = end;
    }
    return scene_.size() - first < rows ? std::optional<uint32_t>() : first;
}

Result<SplatPool::Room> SplatPool::add(const TileIndex& tile, const ScenePoints& points, size_t own,
                                       const PointSplatOptions& options)
{
    SR_CHECK(take_back());
    const auto count = uint32_t(std::min<size_t>(own, scene_.size() + 1ull)); // more never fit
    const uint32_t rows = blocks_of(count);
    std::optional<uint32_t> first = gap(rows, used_);
    if (!first) {
        if (const Room room = room_later(rows, tile); room != Room::found)
            return room;
        first = gap(rows, used_);
    }
    // what allocates comes first, so that memory that is short leaves no half of it
    std::map<uint32_t, uint32_t> used;
    std::map<TileIndex, Place> placed{{tile, {*first, count}}};
    if (count) {
        used.emplace(*first, *first + rows);
        SR_CHECK(fill(*first, points, count, options));
    }
    staged_.make_room({{{*first, rows}}, {{*first, rows}}}); // of these, and of the tile's own of before
    if (count)
        staged_.shown.push_back({*first, rows});
    used_.merge(used);
    remove(tile);
    places_.merge(placed);
    splats_ += count;
    return Room::found;
}

// Is there room once what leaves has left? Where there is not, the tile's own rows of before leave as well. found:
// they have
SplatPool::Room SplatPool::room_later(uint32_t rows, const TileIndex& tile)
{
    std::map<uint32_t, uint32_t> kept;
    for (const auto& [index, place] : places_)
        if (place.count)
            kept[place.first] = place.first + blocks_of(place.count);
    if (gap(rows, kept))
        return Room::later;
    const auto own = places_.find(tile);
    if (own == places_.end() || !own->second.count)
        return Room::none;
    kept.erase(own->second.first);
    if (!gap(rows, kept))
        return Room::none;
    remove(tile);
    return gap(rows, used_) ? Room::found : Room::later;
}

// rows that no draw looks at any more
Status SplatPool::take_back()
{
    const std::lock_guard lock(mutex_);
    for (size_t i = leaving_.size(); i-- > 0;) {
        SR_TRY(const bool gone, device_.reached(leaving_[i].done));
        if (!gone)
            continue;
        used_.erase(leaving_[i].rows.first);
        leaving_.erase(leaving_.begin() + ptrdiff_t(i));
    }
    return {};
}

Status SplatPool::fill(uint32_t first, const ScenePoints& points, uint32_t own, const PointSplatOptions& options)
{
    SR_CHECK(rooms_.prepare(points.size(), options)); // which records commands of its own
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    SR_TRY(const SplatScene* splats, rooms_.record(commands, points, own, options));
    scene_.record_put(commands, first, *splats, blocks_of(own));
    SR_TRY(made_, commands_->submit());
    return {};
}

void SplatPool::remove(const TileIndex& tile)
{
    const auto place = places_.find(tile);
    if (place == places_.end())
        return;
    if (place->second.count)
        leave(place->second);
    splats_ -= place->second.count;
    places_.erase(place);
}

// rows that were never shown are free at once
void SplatPool::leave(const Place& place)
{
    const Rows rows{place.first, blocks_of(place.count)};
    const std::lock_guard lock(mutex_);
    if (std::erase(staged_.shown, rows) || std::erase(published_.shown, rows))
        used_.erase(rows.first);
    else
        staged_.hidden.push_back(rows);
}

Status SplatPool::publish()
{
    SR_CHECK(device_.wait(made_));
    const std::lock_guard lock(mutex_);
    published_.take(staged_);
    return {};
}

bool SplatPool::record_updates(VkCommandBuffer commands)
{
    {
        const std::lock_guard lock(mutex_);
        showing_.take(published_);
        leaving_.reserve(leaving_.size() + showing_.hidden.size());
    }
    // what left before it was ever shown, as nothing was submitted
    std::erase_if(showing_.shown, [&](const Rows& rows) { return std::ranges::count(showing_.hidden, rows) > 0; });
    if (showing_.shown.empty() && showing_.hidden.empty())
        return false;
    next_shown_.clear();
    for (const Rows& rows : showing_.shown)
        next_shown_.emplace(rows.first, rows.first + rows.count);
    const BufferSlice blocks = scene_.blocks().slice();
    const VulkanCalls& vk = device_.vk();
    const auto fill = [&](const Rows& rows, uint32_t value) {
        record_fill(vk, commands, blocks.buffer->handle(), blocks.offset + rows.first / kBlock * sizeof(uint32_t),
                    rows.count / kBlock * sizeof(uint32_t), value);
    };
    record_entry_barrier(vk, commands);
    for (const Rows& rows : showing_.shown)
        fill(rows, 1);
    for (const Rows& rows : showing_.hidden)
        fill(rows, 0);
    record_exit_barrier(vk, commands);
    return true;
}

// allocates nothing: record_updates() has
void SplatPool::updates_are_submitted(const TimelinePoint& done)
{
    shown_.merge(next_shown_);
    const std::lock_guard lock(mutex_);
    for (const Rows& rows : showing_.hidden) {
        leaving_.push_back({rows, done});
        shown_.erase(rows.first);
    }
    showing_.shown.clear();
    showing_.hidden.clear();
    ++version_;
}

} // namespace semrover
