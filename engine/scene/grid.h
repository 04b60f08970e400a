// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace semrover {

using Cell = std::array<int32_t, 3>;        // (i, j, k): spans [i, i+1) x [j, j+1) x [k, k+1) voxel sizes
constexpr int32_t kMaxCoordinate = 1 << 20; // 629 km of 0.6 m voxels; products of differences stay within 64 bits
constexpr int kMaxPointsPerVoxel = 4096;

// a scene of V labelled voxels, each with n coloured surface points or none (docs/formats.md §2.1).
// World frame: metres, x forward, y left, z up. Arrays are row-major.
struct VoxelGrid {
    float voxel_size = 0;           // metres, edge of a voxel
    int points_per_voxel = 0;       // n; 0 when the file of a semantic grid does not say
    std::vector<Cell> cells;        // [V], unique, sorted by (i, j, k)
    std::vector<uint8_t> labels;    // [V], < kClassCount
    std::vector<uint16_t> points;   // [V, n, 3] f16 bits, metres from the voxel's centre; empty for a semantic grid
    std::vector<uint8_t> colors;    // [V, n, 3] sRGB; empty when points are
    std::vector<uint8_t> generated; // [V], 0 = only a label so far; empty when points are
    std::map<std::string, std::string> metadata; // the rest: frame, name, seed, model hash, tool version, ...

    bool has_points() const { return !points.empty(); }
};

// metres
std::array<float, 3> cell_center(const Cell& cell, float voxel_size);

// index of a voxel, by binary search; none if the grid does not have it
std::optional<size_t> find_cell(const VoxelGrid& grid, const Cell& cell);

// Appends voxel `index` of `from`, with its label and points, to `to`. Both have points or both have none.
void append_cell(VoxelGrid& to, const VoxelGrid& from, size_t index);

// Sorts the voxels of a grid, with their labels and points. Array sizes must agree.
void sort_cells(VoxelGrid& grid);

// bad_input, with `where` in front, for: no cells, arrays that disagree in size, a voxel size outside 1 mm..1 km, cells
// that are unsorted, given twice or beyond 2^20, unknown labels (listed with counts), points that are not finite or
// more than 1 mm outside their voxel
Status check_grid(const VoxelGrid& grid, std::string_view where);

// Reads a .sgrid file, with voxels in any order. Without `generated`, voxels with points count as generated.
Result<VoxelGrid> read_grid(const Path& path);

// Writes a .sgrid file atomically; the same grid gives the same bytes. Refuses what check_grid refuses.
Status write_grid(const Path& path, const VoxelGrid& grid);

} // namespace semrover
