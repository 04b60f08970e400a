// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/label_map.h"
#include "engine/scene/scene_grid.h"

namespace semrover {

constexpr int64_t kMaxEdge = 1'000'000; // of a voxel and of a cell, 100 m: a cell's volume stays within 64 bits

// A box of labelled voxels. Lengths are whole tenths of a millimetre, so that boundaries of voxels and cells that
// should agree do, and votes are exact.
struct DenseLabels {
    std::array<uint32_t, 3> shape{}; // voxels along x, y, z
    std::array<int64_t, 3> edge{};   // of a voxel, 0.1 mm
    std::array<int64_t, 3> origin{}; // lower corner of voxel (0, 0, 0), 0.1 mm
    std::vector<uint8_t> labels;     // [x, y, z]: a class; anything else is empty
};

// metres to tenths of a millimetre; bad_input, with `where` in front, unless they are whole to a float's precision
Result<int64_t> tenths_of(double metres, std::string_view where);

// Cells of `voxel_size` whose boundaries are multiples of it. A cell takes the label that fills the largest volume of
// it, ties to the lower label; empty voxels have no vote. It is a cell where voxels fill any of it, or at least
// `min_fill` of its volume. Where a cell is 3 x 3 x 3 voxels this is the majority of the 27. bad_input for a voxel size
// that is not whole tenths of a millimetre, above 100 m or so small that the box has more than 2^28 cells, and when
// nothing is occupied. `warnings`: doubled_ground
Result<VoxelGrid> resample(const DenseLabels& dense, float voxel_size, double min_fill, std::string_view where,
                           std::vector<std::string>* warnings = nullptr);

// --min-fill, where voxels are as large as cells and their boundaries the same
std::vector<UnusedOption> unused_options(const DenseLabels& dense, float voxel_size);

// a grid's labels in a box of smaller voxels, `dense` giving shape, edge (a divisor of the cell's) and origin: each
// cell is split. Parts of cells outside the box are cut off; bad_input when a whole cell is outside, saying how many.
Status split_into(DenseLabels& dense, const VoxelGrid& grid, std::string_view where);

} // namespace semrover
