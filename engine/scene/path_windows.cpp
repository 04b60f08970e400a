// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/path_windows.h"

#include "engine/scene/cell_reach.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kMostWindows = 1 << 20;

double apart(const GroundPoint& a, const GroundPoint& b)
{
    return std::hypot(a[0] - b[0], a[1] - b[1]);
}

} // namespace

Result<PathWindows> PathWindows::cut(const CameraPath& path, double window)
{
    SR_ASSERT(window > 0 && !path.frames.empty(), "windows of {} m, {} frames", window, path.frames.size());
    PathWindows w;
    w.step_ = window;
    for (const CameraFrame& frame : path.frames) {
        const Rigid m = frame.pose.camera_to_world();
        const GroundPoint p = {m[3], m[7]};
        if (!w.points_.empty() && apart(w.points_.back(), p) < 1e-6)
            continue;
        w.along_.push_back(w.points_.empty() ? 0 : w.along_.back() + apart(w.points_.back(), p));
        w.points_.push_back(p);
    }
    const double count = std::ceil(w.length() / window - 1e-9);
    if (!(count <= kMostWindows))
        return fail(ErrorCode::bad_input, "a path of {:.0f} m has {:.0f} windows of {} m, at most {} are allowed",
                    w.length(), count, window, kMostWindows);
    w.count_ = std::max<size_t>(1, size_t(count));
    return w;
}

GroundPoint PathWindows::at(double metres) const
{
    const size_t next = size_t(std::ranges::upper_bound(along_, metres) - along_.begin());
    if (next == 0 || next == points_.size())
        return next == 0 ? points_.front() : points_.back();
    const GroundPoint &a = points_[next - 1], &b = points_[next];
    const double t = (metres - along_[next - 1]) / (along_[next] - along_[next - 1]);
    return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])};
}

std::vector<GroundPoint> PathWindows::piece(size_t window) const
{
    const double low = begin(window), high = end(window);
    std::vector<GroundPoint> corners{at(low)};
    for (size_t i = 0; i < points_.size(); ++i)
        if (along_[i] > low && along_[i] < high)
            corners.push_back(points_[i]);
    if (high > low)
        corners.push_back(at(high));
    return corners;
}

double distance_to(const std::vector<GroundPoint>& piece, const GroundPoint& p)
{
    double best = apart(piece.front(), p);
    for (size_t i = 1; i < piece.size(); ++i) {
        const GroundPoint &a = piece[i - 1], &b = piece[i];
        const double x = b[0] - a[0], y = b[1] - a[1], square = x * x + y * y;
        const double t = square > 0 ? std::clamp(((p[0] - a[0]) * x + (p[1] - a[1]) * y) / square, 0.0, 1.0) : 0;
        best = std::min(best, apart({a[0] + t * x, a[1] + t * y}, p));
    }
    return best;
}

CellWindow window_around(const std::vector<GroundPoint>& piece, double margin, float voxel_size)
{
    GroundPoint low = piece.front(), high = piece.front();
    for (const GroundPoint& p : piece)
        for (size_t a = 0; a < 2; ++a) {
            low[a] = std::min(low[a], p[a]);
            high[a] = std::max(high[a], p[a]);
        }
    const Cell first = cell_at({low[0] - margin, low[1] - margin, 0}, voxel_size);
    const Cell last = cell_at({high[0] + margin, high[1] + margin, 0}, voxel_size);
    return {{first[0], first[1]}, {last[0], last[1]}};
}

std::vector<uint32_t> cells_to_grow(const VoxelGrid& grid, const std::vector<GroundPoint>& piece, double horizon)
{
    std::vector<uint32_t> cells;
    const double edge = decimal_voxel_size(grid.voxel_size);
    for (uint32_t c = 0; c < grid.cells.size(); ++c) {
        const Cell& cell = grid.cells[c];
        if (grid.has_points() && grid.generated[c])
            continue;
        if (distance_to(piece, {(cell[0] + 0.5) * edge, (cell[1] + 0.5) * edge}) <= horizon)
            cells.push_back(c);
    }
    return cells;
}

int64_t nearest_cell(const VoxelGrid& grid, const GroundPoint& point)
{
    const double edge = decimal_voxel_size(grid.voxel_size);
    int64_t best = 0;
    double nearest = 1e300;
    for (size_t c = 0; c < grid.cells.size(); ++c) {
        const double x = (grid.cells[c][0] + 0.5) * edge - point[0], y = (grid.cells[c][1] + 0.5) * edge - point[1];
        if (x * x + y * y < nearest) {
            nearest = x * x + y * y;
            best = int64_t(c);
        }
    }
    return best;
}

} // namespace semrover
