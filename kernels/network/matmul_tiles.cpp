// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "kernels/network/matmul_tiles.h"

#include "runtime/graph/variant.h"

#include <algorithm>

namespace semrover {

namespace {

// a tile, and how fast a large one is made where all units have some, relative to 128 x 128
// source: shares of an H200's measured rates of 128 x 128 and 64 x 64, between them by what each loads for a product
struct RatedTile {
    MatmulTile tile;
    double rate;
};
constexpr RatedTile kMatrixTiles[] = {
    {{.rows = 128, .cols = 160, .down = 4, .subgroups = 8, .step = 64}, 1.04},
    {{.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .strip = 32}, 1},
    {{.rows = 128, .cols = 80, .down = 4, .step = 64}, 0.97},
    {{.rows = 64, .cols = 160, .step = 64}, 0.93},
    {{.rows = 128, .cols = 64, .step = 64, .strip = 32}, 0.87},
    {{.rows = 64, .cols = 64, .step = 64, .strip = 32}, 0.65},
    {{.rows = 32, .cols = 32, .step = 128}, 0.36},
};
constexpr RatedTile kSimtTiles[] = {{{.rows = 64, .cols = 64}, 1}, {{.rows = 32, .cols = 32}, 0.6}};
constexpr uint32_t kMostSums = 128;     // of a lane, or a device keeps them in memory
constexpr size_t kMostAlternatives = 4; // that runs on a device try

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
MatmulTiles lane_tiles(const MatmulShape& shape, uint32_t all)
{
    constexpr uint32_t kLaneRows = 16;
    const uint32_t lane_cols = shape.narrow ? 8 : 16;
    const auto tile = [&](uint32_t across) { return Tile{kLaneRows * (all / across), lane_cols * across}; };
    const auto outputs = [&](uint32_t across) {
        return uint64_t(round_up(shape.rows, tile(across).rows)) * round_up(shape.cols, tile(across).cols);
    };
    uint32_t best = 4; // outputs of a workgroup that are as many rows as columns, or half
    for (uint32_t across = all; across >= 1; across /= 2)
        if (outputs(across) < outputs(best))
            best = across;
    return {{{tile(best), {{"kLaneCols", lane_cols}}}}, best};
}

std::vector<ConstantValue> constants_of(const MatmulTile& t, const DeviceLimits& limits, const MatmulShape& shape)
{
    const bool whole = std::ranges::all_of(shape.runs, [&](uint32_t run) { return run % t.step == 0; });
    return {{"kTileM", t.rows},
            {"kTileN", t.cols},
            {"kDown", t.down},
            {"kSubgroups", t.subgroups},
            {"kThreads", t.subgroups * limits.matrix.subgroup},
            {"kTileK", t.step},
            {"kStages", t.stages},
            {"kAhead", t.ahead},
            {"kWholeSteps", whole},
            {"kStrip", t.strip},
            {"kRowsOfTiles", t.rows_of_tiles}};
}

// tiles that a device has room for, with as many columns of K at a time as suit and fit
std::vector<RatedTile> matrix_tiles(const KernelVariant& variant, const DeviceLimits& limits, const MatmulShape& shape)
{
    std::vector<RatedTile> tiles;
    for (RatedTile rated : kMatrixTiles) {
        rated.tile.step = std::min(rated.tile.step, step_of(shape.runs));
        while (rated.tile.step > 32 && !has_room_for(variant, limits, rated.tile))
            rated.tile.step /= 2;
        const uint32_t lanes = rated.tile.subgroups * limits.matrix.subgroup;
        if (has_room_for(variant, limits, rated.tile) && rated.tile.rows * rated.tile.cols <= kMostSums * lanes)
            tiles.push_back(rated);
    }
    return tiles;
}

// Time of all workgroups, each unit of a device with one at a time: a last round of few takes as long as a full one.
double time_of(const RatedTile& rated, const DeviceLimits& limits, const MatmulShape& s)
{
    const Tile tile{rated.tile.rows, rated.tile.cols};
    const uint64_t all = uint64_t(divide_up(s.rows, tile.rows)) * divide_up(s.cols, tile.cols) * s.groups;
    const uint64_t rounds = (all + limits.compute_units - 1) / limits.compute_units;
    return double(rounds * tile.rows * tile.cols) / rated.rate;
}

} // namespace

bool is_little(double flops)
{
    return flops <= 1 << 23;
}

std::vector<ConstantValue> group_constants(const DeviceLimits& limits, std::vector<ConstantValue> others)
{
    if (const MatrixShape& m = limits.matrix; m.m)
        others.insert(others.end(), {{"kMatM", m.m}, {"kMatN", m.n}, {"kMatK", m.k}, {"kThreads", 4 * m.subgroup}});
    return others;
}

bool has_room_for(const KernelVariant& variant, const DeviceLimits& limits, const MatmulTile& t)
{
    return t.step % limits.matrix.k == 0 && t.subgroups * limits.matrix.subgroup <= limits.max_group_threads &&
           shared_bytes(variant, constants_of(t, limits, {})) <= limits.max_shared_bytes;
}

MatmulTiles matmul_tiles(const KernelVariant& variant, const DeviceLimits& limits, const MatmulShape& shape,
                         const MatmulTile* wanted)
{
    if (variant.name == "cpu")
        return lane_tiles(shape, variant.local_size[0]);
    const bool matrices = variant.features & kFeatureCooperativeMatrix;
    std::vector<RatedTile> tiles(std::begin(kSimtTiles), std::end(kSimtTiles));
    if (matrices)
        tiles = wanted ? std::vector{RatedTile{*wanted, 1}} : matrix_tiles(variant, limits, shape);
    std::ranges::stable_sort(tiles, {}, [&](const RatedTile& t) { return time_of(t, limits, shape); });
    tiles.resize(std::min(tiles.size(), kMostAlternatives));
    MatmulTiles made;
    for (const auto& [t, rate] : tiles)
        made.alternatives.push_back({{t.rows, t.cols},
                                     matrices ? constants_of(t, limits, shape)
                                              : std::vector<ConstantValue>{{"kTileM", t.rows}, {"kTileN", t.cols}}});
    return made;
}

} // namespace semrover
