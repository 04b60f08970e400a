// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "kernels/network/matmul_tiles.h"

#include "runtime/graph/variant.h"

#include <algorithm>

namespace semrover {

namespace {

// a square tile, and the workgroups from which a large GPU has enough to do with it
struct SquareTile {
    uint32_t size, enough;
    uint32_t subgroups = 4, step = 32; // of cooperative matrices, where the device has room: kSubgroups, kStep
};
constexpr SquareTile kMatrixTiles[] = {{128, 256, 8, 64}, {64, 128, 4, 64}, {32, 0, 4, 128}};
constexpr SquareTile kSimtTiles[] = {{64, 128}, {32, 0}};

// Columns of K, of 128, 64 or 32, that a workgroup should have at a time: as many as leave an eighth of the steps empty
// at most.
uint32_t step_of(const std::vector<uint32_t>& runs)
{
    for (const uint32_t step : {128u, 64u}) {
        uint64_t columns = 0, padded = 0;
        for (const uint32_t run : runs) {
            columns += run;
            padded += round_up(run, step);
        }
        if (8 * padded <= 9 * columns)
            return step;
    }
    return 32;
}

// Where the lanes of a workgroup may lie otherwise, so many of them side by side, as few outputs as can be are computed
// beyond the last row and column.
MatmulTiles lane_tiles(const KernelVariant& variant, const MatmulShape& shape)
{
    const Tile declared = fixed_tile(variant);
    const uint32_t all = variant.local_size[0], lanes = variant.value("kColLanes");
    const uint32_t lane_rows = declared.rows * lanes / all, lane_cols = declared.cols / lanes;
    const auto outputs = [&](uint32_t across) {
        return uint64_t(round_up(shape.rows, lane_rows * (all / across))) * round_up(shape.cols, lane_cols * across);
    };
    uint32_t best = lanes;
    for (uint32_t across = all; across >= 1; across /= 2)
        if (outputs(across) < outputs(best))
            best = across;
    return {{{{lane_rows * (all / best), lane_cols * best}, {}}}, best};
}

// how many subgroups share a tile, and how much of K they have at a time: as much as there is room for
std::vector<ConstantValue> shared_by(const KernelVariant& variant, const DeviceLimits& limits, const SquareTile& tile,
                                     uint32_t step_that_suits)
{
    std::vector<ConstantValue> constants;
    const auto fits = [&](uint32_t subgroups, uint32_t step) {
        const uint32_t threads = subgroups * limits.matrix.subgroup;
        constants = {{"kTileM", tile.size},
                     {"kTileN", tile.size},
                     {"kSubgroups", subgroups},
                     {"kStep", step},
                     {"kThreads", threads}};
        return threads <= limits.max_group_threads && shared_bytes(variant, constants) <= limits.max_shared_bytes;
    };
    for (const uint32_t subgroups : {tile.subgroups, 4u})
        for (uint32_t step = std::min(tile.step, step_that_suits); step >= 32; step /= 2)
            if (fits(subgroups, step))
                return constants;
    return constants;
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

size_t largest_that_fills(std::span<const SquareTile> tiles, const MatmulShape& s)
{
    for (size_t i = 0; i < tiles.size(); ++i)
        if (uint64_t(divide_up(s.rows, tiles[i].size)) * divide_up(s.cols, tiles[i].size) * s.groups >= tiles[i].enough)
            return i;
    return tiles.size() - 1;
}

} // namespace

std::vector<ConstantValue> matrix_constants(const DeviceLimits& limits, std::vector<ConstantValue> others)
{
    if (const MatrixShape& m = limits.matrix; m.m)
        others.insert(others.end(), {{"kMatM", m.m}, {"kMatN", m.n}, {"kMatK", m.k}, {"kThreads", 4 * m.subgroup}});
    return others;
}

MatmulTiles matmul_tiles(const KernelVariant& variant, const DeviceLimits& limits, const MatmulShape& shape)
{
    if (variant.constant("kColLanes"))
        return lane_tiles(variant, shape);
    const bool matrices = variant.needs & kNeedsCooperativeMatrix;
    const std::span<const SquareTile> tiles = matrices ? matrix_tiles(limits) : std::span(kSimtTiles);
    MatmulTiles made;
    for (const SquareTile& t : tiles)
        made.alternatives.push_back({{t.size, t.size},
                                     matrices ? shared_by(variant, limits, t, step_of(shape.runs))
                                              : std::vector<ConstantValue>{{"kTileM", t.size}, {"kTileN", t.size}}});
    std::ranges::iter_swap(made.alternatives.begin(), made.alternatives.begin() + largest_that_fills(tiles, shape));
    return made;
}

} // namespace semrover
