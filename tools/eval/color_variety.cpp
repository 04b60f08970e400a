// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/point_scores.h"

#include <cmath>

namespace semrover {

namespace {

struct CellColors {
    std::array<double, 3> mean{};
    double deviation = 0; // root mean square over points and channels
};

CellColors colors_of(const VoxelGrid& grid, size_t cell)
{
    const auto n = size_t(grid.points_per_voxel);
    const std::span<const uint8_t> colors(&grid.colors[cell * n * 3], n * 3);
    CellColors c;
    double squares = 0;
    for (size_t i = 0; i < colors.size(); ++i)
        c.mean[i % 3] += colors[i] / 255.0 / double(n);
    for (size_t i = 0; i < colors.size(); ++i)
        squares += std::pow(colors[i] / 255.0 - c.mean[i % 3], 2);
    c.deviation = std::sqrt(squares / double(3 * n));
    return c;
}

struct Block {
    size_t cells = 0;
    std::array<double, 3> sum{};
};

} // namespace

VarietySums& VarietySums::operator+=(const VarietySums& other)
{
    cells += other.cells;
    blocks += other.blocks;
    within += other.within;
    for (size_t c = 0; c < 3; ++c) {
        sum[c] += other.sum[c];
        squares[c] += other.squares[c];
    }
    return *this;
}

double VarietySums::detail() const
{
    return cells ? within / double(cells) : 0;
}

double VarietySums::spread() const
{
    double variance = 0;
    for (size_t c = 0; blocks && c < 3; ++c)
        variance += squares[c] / double(blocks) - std::pow(sum[c] / double(blocks), 2);
    return std::sqrt(std::max(variance, 0.0) / 3);
}

std::array<VarietySums, kClassCount> color_variety(const VoxelGrid& grid, std::span<const uint8_t> used)
{
    std::array<VarietySums, kClassCount> sums;
    std::map<std::pair<uint8_t, Cell>, Block> blocks;
    const double per_block = double(grid.voxel_size) / kVarietyBlock;
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        if (!used[v])
            continue;
        const CellColors colors = colors_of(grid, v);
        const Cell& c = grid.cells[v];
        Cell at{};
        for (size_t a = 0; a < 3; ++a)
            at[a] = int32_t(std::floor((c[a] + 0.5) * per_block));
        Block& block = blocks[{grid.labels[v], at}];
        ++block.cells;
        for (size_t i = 0; i < 3; ++i)
            block.sum[i] += colors.mean[i];
        ++sums[grid.labels[v]].cells;
        sums[grid.labels[v]].within += colors.deviation;
    }
    for (const auto& [key, block] : blocks) {
        if (block.cells < kFewestVarietyCells)
            continue;
        VarietySums& of_class = sums[key.first];
        ++of_class.blocks;
        for (size_t i = 0; i < 3; ++i) {
            const double mean = block.sum[i] / double(block.cells);
            of_class.sum[i] += mean;
            of_class.squares[i] += mean * mean;
        }
    }
    return sums;
}

} // namespace semrover
