// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace semrover {

using CellIndex = std::array<int32_t, 3>;

// rows of a stream come in multiples of this, so that the semantic stream starts at an aligned byte
constexpr uint32_t kRowAlignment = 16;

// Local sets packed one after the other, without padding, as the kernels read them (kernels/network.h, masked joint
// attention).
struct TokenSets {
    std::vector<uint32_t> labels; // [M]; num_classes is the null label
    std::vector<int32_t> cells;   // [M, 4]: i, j, k, 0
    std::vector<uint32_t> sets;   // [M, 2]: first row and number of rows of the row's set
    std::vector<uint32_t> tiles;  // [T, 4]: first row, rows, first row and rows of the set
    std::vector<float> coords;    // [M, 3]: cell index relative to the mean of the set, in voxels
    uint32_t longest = 0;         // rows of the largest set

    uint32_t rows() const { return uint32_t(labels.size()); }
    void add(std::span<const CellIndex> set_cells, std::span<const uint32_t> set_labels);
    // A set that nobody reads up to a multiple of kRowAlignment rows. One tile in any case, if need be of no rows: so
    // smaller sets have no more rows or tiles than larger ones.
    void pad(uint32_t null_label);
};

} // namespace semrover
