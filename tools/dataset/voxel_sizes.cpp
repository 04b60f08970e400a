// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/voxel_sizes.h"

#include "engine/scene/palette.h"
#include "tools/dataset/dense_labels.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kManyDoubled = 0.2; // of the columns that have ground
constexpr double kFuller = 1.3;      // times as full as the other layer: a share separates them

struct InCell {
    Cell cell;
    uint64_t column; // of voxels in the cell
    uint8_t label;

    auto operator<=>(const InCell&) const = default;
};

std::vector<InCell> in_cells(const VoxelGrid& grid, int32_t edge)
{
    std::vector<InCell> voxels(grid.cells.size());
    for (size_t i = 0; i < voxels.size(); ++i) {
        std::array<int32_t, 3> inside{};
        for (size_t a = 0; a < 3; ++a) {
            const int32_t v = grid.cells[i][a];
            voxels[i].cell[a] = v / edge - (v % edge < 0);
            inside[a] = v - voxels[i].cell[a] * edge;
        }
        voxels[i].column = uint64_t(inside[0]) << 32 | uint64_t(inside[1]);
        voxels[i].label = grid.labels[i];
    }
    return voxels;
}

} // namespace

Result<VoxelSizes> voxel_sizes(std::optional<double> said, const SceneGridOptions& o, bool keep, std::string_view where)
{
    if (said && o.file_voxel_size > 0 && std::abs(*said - o.file_voxel_size) > 1e-6 * *said)
        return fail(ErrorCode::bad_input, "{}: says that its voxels are {:.6g} m, `file_voxel_size` says {} m", where,
                    *said, o.file_voxel_size);
    keep &= said.has_value();
    if (!said && o.file_voxel_size > 0)
        said = o.file_voxel_size;
    if (!said && !o.voxel_size)
        return fail(ErrorCode::bad_input,
                    "{}: does not say how large its voxels are: `voxel_size` does, and `file_voxel_size` where "
                    "cells are larger",
                    where);
    if (!said)
        return VoxelSizes{double(*o.voxel_size), *o.voxel_size};
    return VoxelSizes{*said, o.voxel_size.value_or(keep ? float(*said) : kDefaultVoxelSize)};
}

Status coarsen(VoxelGrid& grid, const VoxelSizes& sizes, double min_fill, std::string_view where,
               std::vector<std::string>& warnings)
{
    grid.voxel_size = sizes.cell;
    if (sizes.same())
        return {};
    SR_TRY(const int64_t cell, tenths_of(double(sizes.cell), fmt::format("{}: size of a cell", where)));
    SR_TRY(const int64_t voxel, tenths_of(sizes.voxel, fmt::format("{}: size of a voxel", where)));
    if (voxel < 1 || cell % voxel != 0)
        return fail(ErrorCode::bad_input, "{}: a cell of {} m is not a whole number of voxels of {} m", where,
                    double(cell) / 1e4, double(voxel) / 1e4);
    const auto edge = static_cast<int32_t>(std::min<int64_t>(cell / voxel, 1 << 20));
    std::vector<InCell> voxels = in_cells(grid, edge);
    std::ranges::sort(voxels);
    grid.cells.clear();
    grid.labels.clear();
    std::vector<CellFill> fills;
    const double volume = std::pow(double(edge), 3), least = min_fill * volume * (1 - 1e-9);
    for (size_t first = 0, last; first < voxels.size(); first = last) {
        std::array<size_t, kClassCount> votes{};
        size_t columns = 0;
        for (last = first; last < voxels.size() && voxels[last].cell == voxels[first].cell; ++last) {
            ++votes[voxels[last].label];
            columns += last == first || voxels[last].column != voxels[last - 1].column;
        }
        const double count = double(last - first);
        if (count < least)
            continue;
        grid.cells.push_back(voxels[first].cell);
        grid.labels.push_back(uint8_t(std::ranges::max_element(votes) - votes.begin())); // the first of the largest
        fills.push_back({float(count / volume), float(count / double(columns) / edge)});
    }
    if (grid.cells.empty() && !voxels.empty())
        return fail(ErrorCode::bad_input, "{}: no cell of {} m is filled to {} of its volume", where, sizes.cell,
                    min_fill);
    for (const std::string& line : doubled_ground(grid, fills, sizes.voxel))
        warnings.push_back(line);
    return {};
}

Result<Cell> whole_voxels(const std::array<double, 3>& origin, double voxel)
{
    Cell shift;
    for (size_t a = 0; a < 3; ++a) {
        const double cells = origin[a] / voxel;
        if (!(std::abs(cells) < (1 << 20)) || std::abs(cells - std::round(cells)) > 1e-4)
            return fail(ErrorCode::bad_input, "origin: {} m is not a whole number of voxels of {:.6g} m", origin[a],
                        voxel);
        shift[a] = static_cast<int32_t>(std::lround(cells));
    }
    return shift;
}

std::vector<std::string> doubled_ground(const VoxelGrid& grid, std::span<const CellFill> fills, double voxel)
{
    size_t doubled = 0, columns = 0;
    double fuller = 0, emptier = 0; // of the two layers, summed
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        if (!is_ground(grid.labels[v]))
            continue;
        const auto& [i, j, k] = grid.cells[v];
        const bool on_ground = v && is_ground(grid.labels[v - 1]) && grid.cells[v - 1] == Cell{i, j, k - 1};
        columns += !on_ground;
        if (!on_ground || fills[v].height + fills[v - 1].height > 1 + 1e-6f)
            continue;
        ++doubled;
        fuller += double(std::max(fills[v].volume, fills[v - 1].volume));
        emptier += double(std::min(fills[v].volume, fills[v - 1].volume));
    }
    if (double(doubled) <= kManyDoubled * double(columns))
        return {};
    const bool shifted = VoxelSizes{voxel, grid.voxel_size}.same();
    std::string advice = shifted ? "`origin` in whole cells" : fmt::format("`voxel_size` {:.6g}", voxel);
    advice += " keeps the voxels as they are";
    if (fuller > kFuller * emptier)
        advice +=
            fmt::format(", `min_fill` {:.2g} leaves out the emptier layer", (fuller + emptier) / 2 / double(doubled));
    return {fmt::format("{} of {} columns of ground have two layers of cells: voxels of {:.6g} m straddle the "
                        "boundaries of cells of {:.6g} m; {}",
                        doubled, columns, voxel, grid.voxel_size, advice)};
}

} // namespace semrover
