// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/scene/tiles.h"

#include <optional>
#include <queue>
#include <span>

namespace semrover {

using GroundPoint = std::array<double, 2>; // metres, seen from above

// what a camera looks at
struct WorldFocus {
    std::array<double, 3> position{};  // metres
    std::array<double, 3> direction{}; // of any length; only its part along the ground counts, zero: none
    double radius = 0;                 // metres, seen from above
};
using WorldFoci = std::vector<WorldFocus>;

// so little moved and turned that what is wanted stays the same: by less than an eighth of a tile, and some ten degrees
bool is_nearly(const WorldFocus& a, const WorldFocus& b, double edge);

// metres from a point to the nearest place of a tile
double distance_to_tile(const GroundPoint& point, const TileIndex& tile, double edge);
double distance_to_tile(const WorldFocus& focus, const TileIndex& tile, double edge);

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

// How coarse a tile at that distance is: 0 within `detail_distance`, 1 up to twice as far, 2 up to four times, and so
// on to kCoarsestDetail; always 0 where detail_distance is 0.
constexpr uint32_t kCoarsestDetail = 5;
uint32_t detail_of(double away, double detail_distance);

} // namespace semrover
