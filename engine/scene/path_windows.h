// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/scene/tiles.h"

namespace semrover {

using GroundPoint = std::array<double, 2>; // metres

// A camera path seen from above, cut into windows of equal length: what `generate --along` works through. Frames that
// do not move are left out; cameras of one moment count one after the other.
class PathWindows {
  public:
    // window: metres, above 0. bad_input for more than 2^20 windows
    static Result<PathWindows> cut(const CameraPath& path, double window);

    size_t count() const { return count_; }
    double length() const { return along_.back(); } // metres; 0 for a path of one place
    double begin(size_t window) const { return double(window) * step_; }
    double end(size_t window) const { return std::min(begin(window + 1), length()); }
    // the corners of the path from begin to end, both ends included; one point where it does not move
    std::vector<GroundPoint> piece(size_t window) const;

  private:
    GroundPoint at(double metres) const;

    std::vector<GroundPoint> points_;
    std::vector<double> along_; // metres from the start, one a point
    double step_ = 0;
    size_t count_ = 1;
};

// metres from a point to the nearest place of a piece
double distance_to(const std::vector<GroundPoint>& piece, const GroundPoint& point);

// cells whose centre may lie within `margin` metres of the piece, seen from above
CellWindow window_around(const std::vector<GroundPoint>& piece, double margin, float voxel_size);

// indices of the cells without points whose centres are at most `horizon` metres from the piece, seen from above
std::vector<uint32_t> cells_to_grow(const VoxelGrid& grid, const std::vector<GroundPoint>& piece, double horizon);

// index of the cell whose centre is nearest to a point, seen from above; the first of equals
int64_t nearest_cell(const VoxelGrid& grid, const GroundPoint& point);

} // namespace semrover
