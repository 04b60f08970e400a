// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/kernel_case.h"

#include <array>

// sets of voxels packed one after the other, and the arrays that tell the attention kernels where each set lies
namespace semrover {

using Cell = std::array<int32_t, 3>;
using CellSet = std::vector<Cell>;

struct PackedSets {
    std::vector<int32_t> cells;                 // [rows, 4]
    std::vector<uint32_t> sets, tiles;          // [rows, 2], [tiles, 4]
    std::vector<std::array<uint32_t, 2>> spans; // first row and rows, per set
    uint32_t rows = 0, longest = 0;

    explicit PackedSets(const std::vector<CellSet>& all)
    {
        for (const CellSet& set : all) {
            const uint32_t first = rows, count = uint32_t(set.size());
            spans.push_back({first, count});
            for (const Cell& c : set) {
                cells.insert(cells.end(), {c[0], c[1], c[2], 0});
                sets.insert(sets.end(), {first, count});
            }
            for (uint32_t at = 0; at < count; at += kAttentionTile)
                tiles.insert(tiles.end(), {first + at, std::min(kAttentionTile, count - at), first, count});
            rows += count;
            longest = std::max(longest, count);
        }
        tiles.insert(tiles.end(), 4, 0); // an empty tile
    }
    bool sees(uint32_t i, uint32_t j, int32_t radius2) const
    {
        int64_t sum = 0;
        for (int a = 0; a < 3; ++a) {
            const int64_t d = int64_t(cells[4 * i + a]) - cells[4 * j + a];
            sum += d * d;
        }
        return sets[2 * i] == sets[2 * j] && sum <= radius2;
    }
};

// voxels of a block, and the last one out of everyone's reach
inline CellSet random_set(std::mt19937& random, uint32_t count, bool with_loner)
{
    CellSet set(count);
    for (Cell& c : set)
        for (int32_t& v : c)
            v = int32_t(random() % 9) - 4;
    if (with_loner)
        set.back() = {1000, -70000, 3};
    return set;
}

} // namespace semrover
