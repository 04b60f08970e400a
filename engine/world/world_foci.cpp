// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_foci.h"

#include "engine/scene/cell_reach.h"

#include <cmath>
#include <limits>

namespace semrover {

namespace {

constexpr double kMostRadius = 2000;       // metres; some 140,000 tiles
constexpr int32_t kFarthestCell = 1 << 19; // of a focus

bool is_nearly(const WorldFocus& a, const WorldFocus& b, double edge)
{
    const double moved = std::hypot(a.position[0] - b.position[0], a.position[1] - b.position[1]);
    const double lengths = std::hypot(a.direction[0], a.direction[1]) * std::hypot(b.direction[0], b.direction[1]);
    const double along = a.direction[0] * b.direction[0] + a.direction[1] * b.direction[1];
    const bool same = a.direction[0] == b.direction[0] && a.direction[1] == b.direction[1];
    return a.radius == b.radius && moved < edge / 8 && (same || (lengths > 0 && along > 0.985 * lengths));
}

} // namespace

Status check_foci(const WorldFoci& foci, float voxel_size)
{
    if (foci.empty() || foci.size() > kMostFoci)
        return fail(ErrorCode::usage, "{} foci, expected 1 to {}", foci.size(), kMostFoci);
    for (const WorldFocus& focus : foci) {
        bool finite = std::isfinite(focus.radius);
        for (size_t a = 0; a < 3; ++a)
            finite = finite && std::isfinite(focus.position[a]) && std::isfinite(focus.direction[a]);
        if (!finite || focus.radius < 0 || focus.radius > kMostRadius)
            return fail(ErrorCode::usage, "a focus: expected finite numbers and a radius of 0 to {} m, found {} m",
                        kMostRadius, focus.radius);
        for (size_t a = 0; a < 2; ++a)
            if (std::abs(focus.position[a]) > kFarthestCell * double(voxel_size))
                return fail(ErrorCode::usage, "a focus at {} m is too far out", focus.position[a]);
    }
    return {};
}

bool is_nearly(const WorldFoci& a, const WorldFoci& b, double edge)
{
    return std::ranges::equal(a, b, [&](const auto& one, const auto& other) { return is_nearly(one, other, edge); });
}

double distance_to_tile(const GroundPoint& point, const TileIndex& tile, double edge)
{
    double outside[2];
    for (size_t a = 0; a < 2; ++a)
        outside[a] = std::max({0.0, tile[a] * edge - point[a], point[a] - (tile[a] + 1) * edge});
    return std::hypot(outside[0], outside[1]);
}

double distance_to_tile(const WorldFocus& focus, const TileIndex& tile, double edge)
{
    return distance_to_tile(GroundPoint{focus.position[0], focus.position[1]}, tile, edge);
}

double distance_to_tile(const WorldFoci& foci, const TileIndex& tile, double edge)
{
    double nearest = foci.empty() ? 0 : std::numeric_limits<double>::infinity();
    for (const WorldFocus& focus : foci)
        nearest = std::min(nearest, distance_to_tile(focus, tile, edge));
    return nearest;
}

bool out_of_reach(const WorldFoci& foci, const TileIndex& tile, double edge)
{
    const auto reaches = [&](const WorldFocus& focus) { return distance_to_tile(focus, tile, edge) <= focus.radius; };
    return !foci.empty() && std::ranges::none_of(foci, reaches);
}

CellWindow window_around(const WorldFoci& foci, double margin, float voxel_size)
{
    constexpr double none = std::numeric_limits<double>::infinity();
    Point3 low = {none, none, 0}, high = {-none, -none, 0};
    for (const WorldFocus& focus : foci)
        for (size_t a = 0; a < 2; ++a) {
            low[a] = std::min(low[a], focus.position[a] - focus.radius - margin);
            high[a] = std::max(high[a], focus.position[a] + focus.radius + margin);
        }
    const Cell first = cell_at(low, voxel_size), last = cell_at(high, voxel_size);
    return {{first[0], first[1]}, {last[0], last[1]}};
}

} // namespace semrover
