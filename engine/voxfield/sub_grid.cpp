// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/sub_grid.h"

#include "engine/scene/cell_reach.h"
#include "engine/voxfield/cell_tree.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr int64_t kFirstReach = 8, kLastReach = 64; // voxels

// every target has `count` of the voxels within `reach`
Result<bool> reach_is_enough(const std::vector<Cell>& cells, std::span<const uint32_t> targets, uint32_t count,
                             int64_t reach)
{
    SR_TRY(const CellTree tree, CellTree::build(cells));
    std::vector<uint64_t> keys;
    for (const uint32_t target : targets) {
        tree.nearest(target, count, keys);
        if (keys.size() < count)
            return false;
        for (const uint64_t key : keys) {
            int64_t distance2 = 0;
            for (size_t a = 0; a < 3; ++a) {
                const int64_t d = int64_t(cells[tree.index_of(key)][a]) - cells[target][a];
                distance2 += d * d;
            }
            if (distance2 > reach * reach)
                return false;
        }
    }
    return true;
}

// voxels that are targets or known, of the whole
struct Candidates {
    std::vector<Cell> cells;
    std::vector<uint32_t> indices, targets; // targets: positions among the candidates
};

Candidates candidates_of(const VoxelGrid& whole, std::span<const uint32_t> targets)
{
    Candidates out;
    for (uint32_t c = 0; c < whole.cells.size(); ++c) {
        const bool target = std::ranges::binary_search(targets, c);
        if (!target && !(whole.has_points() && whole.generated[c]))
            continue;
        if (target)
            out.targets.push_back(uint32_t(out.cells.size()));
        out.cells.push_back(whole.cells[c]);
        out.indices.push_back(c);
    }
    return out;
}

SubGrid take(const VoxelGrid& whole, std::span<const uint32_t> cells, std::span<const uint32_t> targets)
{
    SubGrid part;
    part.cells.assign(cells.begin(), cells.end());
    part.grid.voxel_size = whole.voxel_size;
    part.grid.points_per_voxel = whole.points_per_voxel;
    const size_t width = whole.has_points() ? size_t(whole.points_per_voxel) * 3 : 0;
    part.grid.points.reserve(cells.size() * width);
    part.grid.colors.reserve(cells.size() * width);
    for (const uint32_t c : cells) {
        append_cell(part.grid, whole, c);
        if (width)
            part.grid.generated.back() = !std::ranges::binary_search(targets, c);
    }
    return part;
}

} // namespace

Result<SubGrid> cut_sub_grid(const VoxelGrid& whole, std::span<const uint32_t> targets, int considered)
{
    SR_ASSERT(!targets.empty() && std::ranges::is_sorted(targets), "{} targets, in order", targets.size());
    const Candidates all = candidates_of(whole, targets);
    std::vector<Cell> sources;
    for (const uint32_t target : all.targets)
        sources.push_back(all.cells[target]);
    for (int64_t reach = kFirstReach;; reach *= 2) {
        const std::vector<uint32_t> near = cells_within(all.cells, sources, reach * reach);
        std::vector<uint32_t> in_whole, near_targets;
        std::vector<Cell> cells;
        for (const uint32_t c : near) {
            if (std::ranges::binary_search(all.targets, c))
                near_targets.push_back(uint32_t(cells.size()));
            cells.push_back(all.cells[c]);
            in_whole.push_back(all.indices[c]);
        }
        bool enough = reach >= kLastReach || near.size() == all.cells.size();
        if (!enough) {
            SR_TRY(enough, reach_is_enough(cells, near_targets, uint32_t(std::max(considered, 1)), reach));
        }
        if (enough)
            return take(whole, in_whole, targets);
    }
}

void put_back(VoxelGrid& whole, const SubGrid& part, std::span<const uint32_t> targets)
{
    make_room_for_points(whole, part.grid.points_per_voxel);
    const size_t width = size_t(whole.points_per_voxel) * 3;
    for (size_t i = 0; i < part.cells.size(); ++i) {
        const size_t c = part.cells[i];
        if (!part.grid.generated[i] || !std::ranges::binary_search(targets, uint32_t(c)))
            continue;
        std::copy_n(&part.grid.points[i * width], width, &whole.points[c * width]);
        std::copy_n(&part.grid.colors[i * width], width, &whole.colors[c * width]);
        whole.generated[c] = 1;
    }
}

void make_room_for_points(VoxelGrid& grid, int points_per_voxel)
{
    if (grid.has_points())
        return;
    grid.points_per_voxel = points_per_voxel;
    grid.points.assign(grid.cells.size() * size_t(points_per_voxel) * 3, 0);
    grid.colors.assign(grid.points.size(), 0);
    grid.generated.assign(grid.cells.size(), 0);
}

} // namespace semrover
