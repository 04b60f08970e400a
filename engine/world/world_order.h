// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/world/world_foci.h"

#include <optional>
#include <queue>
#include <span>

namespace semrover {

// The places of a trajectory's cameras, without those that do not move. Cameras of one moment count one after the
// other.
std::vector<GroundPoint> ground_track(const CameraPath& path);
double length_of(std::span<const GroundPoint> track); // metres

// The tiles with a place within `horizon` metres of a track, seen from above, in the order in which it comes near them.
// edge: of a tile, in metres
std::vector<TileIndex> tiles_along(std::span<const GroundPoint> track, double horizon, double edge);

// Tiles in the order in which they are wanted. Those of a focus are found as they are asked for, so a wide one costs
// nothing until then.
class TileOrder {
  public:
    TileOrder() = default; // none
    explicit TileOrder(std::vector<TileIndex> tiles);
    // The tiles with a place within the radius of a focus, by the distance of their middle from its position, which
    // counts up to three times as much behind it as ahead; of several foci the nearest counts. edge: of a tile, in
    // metres
    TileOrder(const WorldFoci& foci, double edge);

    size_t size() const { return size_; }                       // of all
    std::optional<TileIndex> at(size_t rank);                   // none: there are no more
    std::optional<size_t> rank_of(const TileIndex& tile) const; // of one that was found

  private:
    struct Disk {
        WorldFocus focus;
        TileIndex first; // under the focus
        int32_t span;
        std::vector<bool> reached; // of the square of tiles around first, 2 * span + 1 wide
    };

    void reach(const TileIndex& tile);
    void find();

    std::vector<Disk> disks_;
    double edge_ = 0;
    std::vector<TileIndex> found_;
    std::map<TileIndex, size_t> ranks_;
    size_t size_ = 0;
    // tiles beside those that were found, with their weights
    using Weighed = std::pair<double, TileIndex>;
    std::priority_queue<Weighed, std::vector<Weighed>, std::greater<>> border_;
};

} // namespace semrover
