// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/street.h"

#include <cmath>
#include <limits>

namespace semrover::view {

namespace {

sr_cell_rect around(int32_t i, int32_t j, int reach)
{
    return {{i - reach, j - reach}, {i + reach, j + reach}};
}

double distance_to(const PlacedCell& cell, const Vector& place)
{
    double least = std::numeric_limits<double>::infinity();
    for (const auto& p : cell.points)
        least = std::min(least, std::hypot(p[0] - place[0], p[1] - place[1], p[2] - place[2]));
    return least;
}

PickedCell picked(const PlacedCell& cell, uint32_t tile_cells)
{
    PickedCell out{cell, {}, {}};
    const double edge = tile_cells;
    out.tile = {int32_t(std::floor(cell.cell.i / edge)), int32_t(std::floor(cell.cell.j / edge))};
    for (const auto& p : cell.points)
        for (size_t c = 0; c < 3; ++c)
            out.color[c] += p[3 + c] / float(cell.points.size());
    return out;
}

} // namespace

Result<std::optional<PickedCell>> pick(const Street& street, const Vector& place)
{
    SR_TRY(const sr_world_info info, street.info());
    std::array<int32_t, 3> at{};
    for (size_t axis = 0; axis < 3; ++axis)
        at[axis] = int32_t(std::clamp(std::floor(place[axis] / info.voxel_size), -1e6, 1e6));
    SR_TRY(const std::vector<PlacedCell> near, street.cells(around(at[0], at[1], 1)));
    const PlacedCell* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const PlacedCell& cell : near) {
        const double away = std::abs(cell.cell.k - at[2]) <= 1 ? distance_to(cell, place) : least;
        if (away < least)
            best = &cell;
        least = std::min(least, away);
    }
    return best ? std::optional(picked(*best, info.tile_cells)) : std::nullopt;
}

Result<std::optional<PickedCell>> pick(const Street& street, const sr_cell& cell)
{
    SR_TRY(const sr_world_info info, street.info());
    SR_TRY(const std::vector<PlacedCell> column, street.cells(around(cell.i, cell.j, 0)));
    for (const PlacedCell& found : column)
        if (found.cell.k == cell.k)
            return picked(found, info.tile_cells);
    return std::nullopt;
}

Result<size_t> Brush::paint(Street& street, const sr_cell& middle)
{
    SR_TRY(const std::vector<PlacedCell> near, street.cells(around(middle.i, middle.j, reach)));
    std::vector<sr_cell> before, after;
    for (const PlacedCell& near_cell : near) {
        sr_cell cell = near_cell.cell;
        if (std::abs(cell.k - middle.k) > reach || cell.label == label)
            continue;
        before.push_back(cell);
        cell.label = label;
        after.push_back(cell);
    }
    if (after.empty())
        return 0;
    SR_CHECK(street.edit(after));
    strokes_.push_back(std::move(before));
    return after.size();
}

Result<size_t> Brush::undo(Street& street)
{
    if (strokes_.empty())
        return 0;
    SR_CHECK(street.edit(strokes_.back()));
    const size_t cells = strokes_.back().size();
    strokes_.pop_back();
    return cells;
}

} // namespace semrover::view
