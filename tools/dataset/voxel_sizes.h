// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_grid.h"

#include <cmath>

namespace semrover {

// metres: of a voxel of a file, and of the cells that are made of them
struct VoxelSizes {
    double voxel;
    float cell;

    bool same() const { return std::abs(double(cell) - voxel) <= 1e-6 * voxel; }
};

// `said`: what the file says of its voxels; options.file_voxel_size or, where neither is there, options.voxel_size say
// it. Cells are as large as options.voxel_size, else as the voxels where the file says their size and `keep`, else
// 0.6 m. bad_input where nothing says how large voxels are, or two say different things.
Result<VoxelSizes> voxel_sizes(std::optional<double> said, const SceneGridOptions& options, bool keep,
                               std::string_view where);

// Makes cells of `cell` metres of a grid's voxels, which a whole number of voxels fills: the commonest label, ties to
// the lower one; a cell where voxels fill any of it, or at least `min_fill` of its volume: the rule of resample().
// bad_input for other sizes, and where nothing is left. `warnings`: doubled_ground
Status coarsen(VoxelGrid& grid, const VoxelSizes& sizes, double min_fill, std::string_view where,
               std::vector<std::string>& warnings);

// an origin in whole voxels, by which a grid's cells are shifted; bad_input where it is not
Result<Cell> whole_voxels(const std::array<double, 3>& origin, double voxel);

// A line where cells make two layers of ground of one that is no thicker than a cell, because its voxels straddle their
// boundary. A fill for each cell. Cells are sorted.
struct CellFill {
    float volume; // how much of the cell voxels fill
    float height; // of its height, where they fill any
};
std::vector<std::string> doubled_ground(const VoxelGrid& grid, std::span<const CellFill> fills, double voxel);

} // namespace semrover
