// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/splat_pool.h"

#include <algorithm>

namespace semrover {

Result<std::unique_ptr<SplatPool>> SplatPool::create(Device& device, uint64_t bytes)
{
    const uint64_t rows = bytes / kSurfelBytes;
    const uint64_t most = std::min(device.limits().max_storage_range, device.limits().max_allocation) / 16;
    if (rows < 1 || rows > most)
        return fail(ErrorCode::usage, "splats of {} bytes: expected {} to {}, as much as this device can bind", bytes,
                    kSurfelBytes, most * kSurfelBytes);
    SR_TRY(SurfelScene scene, SurfelScene::reserve(device, uint32_t(rows)));
    std::unique_ptr<SplatPool> pool(new SplatPool(device, std::move(scene)));
    SR_TRY(pool->copies_, CopyRing::create(device));
    return pool;
}

uint32_t SplatPool::end() const
{
    return used_.empty() ? 0 : used_.rbegin()->second;
}

Result<bool> SplatPool::add(const TileIndex& tile, const SurfelScene& surfels)
{
    SR_CHECK(remove(tile));
    uint32_t first = 0;
    for (const auto& [begin, end] : used_) {
        if (begin - first >= surfels.size())
            break;
        first = end;
    }
    if (scene_.size() - first < surfels.size())
        return false;
    if (surfels.size()) {
        SR_CHECK(scene_.put(*copies_, first, surfels));
        used_[first] = first + surfels.size();
    }
    places_[tile] = {first, surfels.size()};
    surfels_ += surfels.size();
    ++version_;
    return true;
}

Status SplatPool::remove(const TileIndex& tile)
{
    const auto place = places_.find(tile);
    if (place == places_.end())
        return {};
    const auto [first, count] = place->second;
    if (count) {
        SR_CHECK(scene_.hide(first, count));
        used_.erase(first);
    }
    surfels_ -= count;
    places_.erase(place);
    ++version_;
    return {};
}

} // namespace semrover
