// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// part of stage 3: the tile of the output that a workgroup makes
#include "runtime/graph/plan.h"

#include "runtime/graph/protocol.h"

#include <algorithm>

namespace semrover {

namespace {

// Square tiles that a variant can make, and the workgroups from which a large GPU has enough to do with each. All give
// the same bits, so the choice may depend on the number of rows.
struct SquareTile {
    uint32_t size, enough;
    uint32_t subgroups = 4, step = 32; // of cooperative matrices, where the device has room: kSubgroups, kStep
};
constexpr SquareTile kMatrixTiles[] = {{128, 256, 8, 64}, {64, 128, 4, 64}, {32, 0, 4, 128}};
constexpr SquareTile kSimtTiles[] = {{64, 128}, {32, 0}};

// Where the lanes of a workgroup may lie otherwise (col_lanes of them side by side), as few outputs as can be are
// computed beyond the last row and column.
void fit_lanes(Pass& pass)
{
    const ConstantInfo *lanes = pass.variant->constant(protocol::kColLanes),
                       *m = pass.variant->constant(protocol::kTileRows),
                       *n = pass.variant->constant(protocol::kTileCols);
    if (m)
        pass.tile_rows = m->value;
    if (n)
        pass.tile_cols = n->value;
    if (!lanes || pass.grid.unit != Grid::Unit::tiles)
        return;
    const uint32_t all = pass.variant->local_size[0];
    const uint32_t lane_rows = m->value * lanes->value / all, lane_cols = n->value / lanes->value;
    const auto outputs = [&](uint32_t across) {
        return uint64_t(round_up(pass.grid.x, lane_rows * (all / across))) * round_up(pass.grid.y, lane_cols * across);
    };
    uint32_t best = lanes->value;
    for (uint32_t across = all; across >= 1; across /= 2)
        if (outputs(across) < outputs(best))
            best = across;
    pass.tile_rows = lane_rows * (all / best);
    pass.tile_cols = lane_cols * best;
    pass.set_push(protocol::kColLanesMember, best);
}

// shape and threads of cooperative matrices
void fit_matrices(Pass& pass, const MatrixShape& shape)
{
    pass.set_constant(protocol::kMatM, shape.m);
    pass.set_constant(protocol::kMatN, shape.n);
    pass.set_constant(protocol::kMatK, shape.k);
    pass.set_constant(protocol::kThreads, 4 * shape.subgroup);
}

// how many subgroups share a tile, and how much of K they have at a time: as much as there is room for
void share_tile(Pass& pass, const SquareTile& tile, const DeviceLimits& limits)
{
    const uint32_t suits = pass.options.depth_step ? pass.options.depth_step : tile.step;
    const auto fits = [&](uint32_t subgroups, uint32_t step) {
        pass.set_constant(protocol::kSubgroups, subgroups);
        pass.set_constant(protocol::kStep, step);
        pass.set_constant(protocol::kThreads, subgroups * limits.matrix.subgroup);
        return subgroups * limits.matrix.subgroup <= limits.max_group_threads &&
               shared_bytes(*pass.variant, pass.constants) <= limits.max_shared_bytes;
    };
    for (const uint32_t subgroups : {tile.subgroups, 4u})
        for (uint32_t step = std::min(tile.step, suits); step >= 32; step /= 2)
            if (fits(subgroups, step))
                return;
}

// of cooperative matrices: a lane holds 128 sums at most, and has something to load
std::span<const SquareTile> matrix_tiles(const DeviceLimits& limits)
{
    constexpr uint32_t kMostSums = 128, kLoadsOfSmall = 32 * 32 / 8;
    const uint32_t threads = 4 * limits.matrix.subgroup;
    const size_t first = kMatrixTiles[0].size * kMatrixTiles[0].size / threads > kMostSums;
    const size_t last = threads <= kLoadsOfSmall ? 3 : 2;
    return std::span(kMatrixTiles).subspan(first, last - first);
}

bool makes(const KernelVariant& variant, uint32_t tile)
{
    const ConstantInfo *m = variant.constant(protocol::kTileRows), *n = variant.constant(protocol::kTileCols);
    return m && n && m->value == tile && n->value == tile;
}

std::span<const SquareTile> square_tiles(const Pass& pass, const DeviceLimits& limits)
{
    if (const ConstantInfo* c = pass.variant->constant(protocol::kAddSlices); c && pass.constants.contains(c->id))
        return {};
    if (pass.variant->needs & kNeedsCooperativeMatrix)
        return makes(*pass.variant, kMatrixTiles[0].size) ? matrix_tiles(limits) : std::span<const SquareTile>();
    if (pass.variant->name == "simt" && makes(*pass.variant, kSimtTiles[0].size))
        return kSimtTiles;
    return {};
}

uint64_t workgroups(const Pass& pass, uint32_t tile)
{
    return uint64_t(divide_up(pass.grid.x, tile)) * divide_up(pass.grid.y, tile) * std::max(pass.grid.z, 1u);
}

uint32_t largest_that_fills(const Pass& pass, std::span<const SquareTile> tiles)
{
    for (const SquareTile& t : tiles)
        if (workgroups(pass, t.size) >= t.enough)
            return t.size;
    return tiles.back().size;
}

} // namespace

std::vector<uint32_t> tiles_of(const Pass& pass, const DeviceLimits& limits)
{
    std::vector<uint32_t> sizes;
    for (const SquareTile& tile : square_tiles(pass, limits))
        sizes.push_back(tile.size);
    return sizes;
}

void Pass::set_tile(uint32_t tile, const DeviceLimits& limits)
{
    tile_rows = tile_cols = tile;
    set_constant(protocol::kTileRows, tile);
    set_constant(protocol::kTileCols, tile);
    if (variant->constant(protocol::kStep))
        share_tile(*this, *std::ranges::find(kMatrixTiles, tile, &SquareTile::size), limits);
}

void stage::fit_tile(Pass& pass, const DeviceLimits& limits)
{
    fit_lanes(pass);
    if (pass.variant->needs & kNeedsCooperativeMatrix)
        fit_matrices(pass, limits.matrix);
    if (const auto tiles = square_tiles(pass, limits); !tiles.empty())
        pass.set_tile(largest_that_fills(pass, tiles), limits);
}

} // namespace semrover
