// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_order.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace semrover {

namespace {

int32_t tile_at(double metres, double edge)
{
    return int32_t(std::floor(metres / edge));
}

double weight(const WorldFocus& focus, const TileIndex& tile, double edge)
{
    const double x = (tile[0] + 0.5) * edge - focus.position[0], y = (tile[1] + 0.5) * edge - focus.position[1];
    const double away = std::hypot(x, y), length = std::hypot(focus.direction[0], focus.direction[1]);
    if (away == 0 || !(length > 0))
        return away;
    return away * (2 - (x * focus.direction[0] + y * focus.direction[1]) / (away * length));
}

// how many tiles foci have together: a row of them for each focus and index along x
size_t tiles_within(const WorldFoci& foci, double edge)
{
    std::vector<std::array<int32_t, 3>> rows; // index along x; first and last along y
    for (const WorldFocus& focus : foci) {
        const auto& [x, y, z] = focus.position;
        for (int32_t i = tile_at(x - focus.radius, edge); i <= tile_at(x + focus.radius, edge); ++i) {
            const double away = std::max({0.0, i * edge - x, x - (i + 1) * edge});
            const double half = std::sqrt(std::max(0.0, focus.radius * focus.radius - away * away));
            rows.push_back({i, tile_at(y - half, edge), tile_at(y + half, edge)});
        }
    }
    std::ranges::sort(rows);
    size_t count = 0;
    std::optional<int32_t> column;
    int32_t end = 0; // last of the column that is counted
    for (const auto& [i, from, to] : rows) {
        const int32_t first = column == i ? std::max(from, end + 1) : from;
        count += size_t(std::max(0, to - first + 1));
        end = column == i ? std::max(end, to) : to;
        column = i;
    }
    return count;
}

double apart(const GroundPoint& a, const GroundPoint& b)
{
    return std::hypot(a[0] - b[0], a[1] - b[1]);
}

double distance_to_segment(const GroundPoint& p, const GroundPoint& a, const GroundPoint& b)
{
    const double x = b[0] - a[0], y = b[1] - a[1], square = x * x + y * y;
    const double t = square > 0 ? std::clamp(((p[0] - a[0]) * x + (p[1] - a[1]) * y) / square, 0.0, 1.0) : 0;
    return apart({a[0] + t * x, a[1] + t * y}, p);
}

// the segment has a point inside
bool crosses(const GroundPoint& a, const GroundPoint& b, const TileIndex& tile, double edge)
{
    double from = 0, to = 1;
    for (size_t axis = 0; axis < 2; ++axis) {
        const double low = tile[axis] * edge - a[axis], high = low + edge, step = b[axis] - a[axis];
        if (step == 0) {
            if (low > 0 || high < 0)
                return false;
            continue;
        }
        from = std::max(from, std::min(low / step, high / step));
        to = std::min(to, std::max(low / step, high / step));
    }
    return from <= to;
}

double distance_from_segment(const GroundPoint& a, const GroundPoint& b, const TileIndex& tile, double edge)
{
    if (crosses(a, b, tile, edge))
        return 0;
    double best = std::min(distance_to_tile(a, tile, edge), distance_to_tile(b, tile, edge));
    for (const int32_t x : {0, 1})
        for (const int32_t y : {0, 1})
            best = std::min(best, distance_to_segment({(tile[0] + x) * edge, (tile[1] + y) * edge}, a, b));
    return best;
}

// adds the tiles near a segment, those near its beginning first
void add_near(std::vector<TileIndex>& tiles, std::set<TileIndex>& seen, const GroundPoint& a, const GroundPoint& b,
              double horizon, double edge)
{
    std::vector<std::pair<double, TileIndex>> near;
    for (int32_t x = tile_at(std::min(a[0], b[0]) - horizon, edge); x <= tile_at(std::max(a[0], b[0]) + horizon, edge);
         ++x)
        for (int32_t y = tile_at(std::min(a[1], b[1]) - horizon, edge);
             y <= tile_at(std::max(a[1], b[1]) + horizon, edge); ++y)
            if (const TileIndex tile{x, y}; !seen.contains(tile) && distance_from_segment(a, b, tile, edge) <= horizon)
                near.emplace_back(distance_to_tile(a, tile, edge), tile);
    std::ranges::sort(near);
    for (const auto& [away, tile] : near) {
        tiles.push_back(tile);
        seen.insert(tile);
    }
}

} // namespace

std::vector<GroundPoint> ground_track(const CameraPath& path)
{
    std::vector<GroundPoint> track;
    for (const CameraFrame& frame : path.frames) {
        const Rigid m = frame.pose.camera_to_world();
        const GroundPoint point = {m[3], m[7]};
        if (track.empty() || apart(track.back(), point) >= 1e-6)
            track.push_back(point);
    }
    return track;
}

double length_of(std::span<const GroundPoint> track)
{
    double length = 0;
    for (size_t i = 1; i < track.size(); ++i)
        length += apart(track[i - 1], track[i]);
    return length;
}

std::vector<TileIndex> tiles_along(std::span<const GroundPoint> track, double horizon, double edge)
{
    std::vector<TileIndex> tiles;
    std::set<TileIndex> seen;
    for (size_t i = 0; i + 1 < track.size() || i == 0; ++i) {
        const GroundPoint &a = track[i], &b = track[std::min(i + 1, track.size() - 1)];
        const auto pieces = std::max(1.0, std::ceil(apart(a, b) / edge));
        const auto at = [&](double piece) {
            return GroundPoint{a[0] + (b[0] - a[0]) * piece / pieces, a[1] + (b[1] - a[1]) * piece / pieces};
        };
        for (double piece = 0; piece < pieces; ++piece)
            add_near(tiles, seen, at(piece), at(piece + 1), horizon, edge);
    }
    return tiles;
}

TileOrder::TileOrder(std::vector<TileIndex> tiles) : found_(std::move(tiles)), size_(found_.size())
{
    for (size_t rank = 0; rank < found_.size(); ++rank)
        ranks_.emplace(found_[rank], rank);
}

TileOrder::TileOrder(const WorldFoci& foci, double edge) : edge_(edge), size_(tiles_within(foci, edge))
{
    for (const WorldFocus& focus : foci) {
        const int32_t span = int32_t(std::ceil(focus.radius / edge)) + 2;
        disks_.push_back({focus, {tile_at(focus.position[0], edge), tile_at(focus.position[1], edge)}, span, {}});
        disks_.back().reached.resize(size_t(2 * span + 1) * size_t(2 * span + 1));
    }
    for (size_t d = 0; d < disks_.size(); ++d)
        reach(disks_[d].first);
}

// note: the nearest tiles come at once, as the one under the camera need not be the first
void TileOrder::reach(const TileIndex& tile)
{
    for (int32_t x = -1; x <= 1; ++x)
        for (int32_t y = -1; y <= 1; ++y) {
            const TileIndex beside{tile[0] + x, tile[1] + y};
            const auto has = [&](const Disk& d) { return distance_to_tile(d.focus, beside, edge_) <= d.focus.radius; };
            const auto first = std::ranges::find_if(disks_, has); // which remembers it
            if (first == disks_.end())
                continue;
            const int32_t column = beside[0] - first->first[0] + first->span;
            const int32_t row = beside[1] - first->first[1] + first->span;
            const size_t bit = size_t(column) * size_t(2 * first->span + 1) + size_t(row);
            if (first->reached[bit])
                continue;
            first->reached[bit] = true;
            double nearest = weight(first->focus, beside, edge_);
            for (auto other = first + 1; other != disks_.end(); ++other)
                if (has(*other))
                    nearest = std::min(nearest, weight(other->focus, beside, edge_));
            border_.emplace(nearest, beside);
        }
}

void TileOrder::find()
{
    const TileIndex tile = border_.top().second;
    border_.pop();
    ranks_.emplace(tile, found_.size());
    found_.push_back(tile);
    reach(tile);
    if (border_.empty())
        size_ = found_.size(); // rounding may have counted one more or less
}

std::optional<TileIndex> TileOrder::at(size_t rank)
{
    while (rank >= found_.size() && !border_.empty())
        find();
    return rank < found_.size() ? std::optional(found_[rank]) : std::nullopt;
}

std::optional<size_t> TileOrder::rank_of(const TileIndex& tile) const
{
    const auto entry = ranks_.find(tile);
    return entry == ranks_.end() ? std::nullopt : std::optional(entry->second);
}

} // namespace semrover
