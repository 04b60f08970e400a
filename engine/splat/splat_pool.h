// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"
#include "engine/splat/surfels.h"
#include "runtime/device/copy_ring.h"

namespace semrover {

// The surfels of a world's tiles in one scene of fixed size: tiles come and go, and the others stay where they are.
// Rows that no tile has are surfels without opacity, which are not drawn.
class SplatPool {
  public:
    static constexpr uint32_t kSurfelBytes = 56; // in five arrays

    // bytes: of device memory, for bytes / kSurfelBytes surfels. Errors: usage where not one fits, or an array is
    // larger than the device can bind; out_of_memory
    static Result<std::unique_ptr<SplatPool>> create(Device& device, uint64_t bytes);

    const SurfelScene& scene() const { return scene_; }
    uint32_t end() const; // rows from here on have never a tile now: what a draw needs to look at
    uint64_t version() const { return version_; } // moves with every change
    size_t surfels() const { return surfels_; }

    // puts a tile's surfels where there is room, behind what was submitted before. false: there is none
    Result<bool> add(const TileIndex& tile, const SurfelScene& surfels);
    Status remove(const TileIndex& tile); // one that is not there is fine
    bool has(const TileIndex& tile) const { return places_.contains(tile); }

    struct Place {
        uint32_t first = 0, count = 0; // rows
    };
    const std::map<TileIndex, Place>& places() const { return places_; }

  private:
    SplatPool(Device& device, SurfelScene scene) : device_(device), scene_(std::move(scene)) {}

    Device& device_;
    SurfelScene scene_;
    std::unique_ptr<CopyRing> copies_;
    std::map<TileIndex, Place> places_;
    std::map<uint32_t, uint32_t> used_; // rows: first, end
    uint64_t version_ = 0;
    size_t surfels_ = 0;
};

} // namespace semrover
