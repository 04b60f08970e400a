// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/token_sets.h"

#include "kernels/network.h"

#include <algorithm>

namespace semrover {

void TokenSets::add(std::span<const CellIndex> set_cells, std::span<const uint32_t> set_labels)
{
    SR_ASSERT(!set_cells.empty() && set_cells.size() == set_labels.size(), "a set of {} cells with {} labels",
              set_cells.size(), set_labels.size());
    const uint32_t first = rows(), count = uint32_t(set_cells.size());
    double mean[3] = {};
    for (const CellIndex& c : set_cells)
        for (int a = 0; a < 3; ++a)
            mean[a] += double(c[a]) / count;
    for (uint32_t i = 0; i < count; ++i) {
        labels.push_back(set_labels[i]);
        sets.insert(sets.end(), {first, count});
        cells.insert(cells.end(), {set_cells[i][0], set_cells[i][1], set_cells[i][2], 0});
        for (int a = 0; a < 3; ++a)
            coords.push_back(float(set_cells[i][a] - mean[a]));
    }
    for (uint32_t at = 0; at < count; at += kAttentionTile)
        tiles.insert(tiles.end(), {first + at, std::min(kAttentionTile, count - at), first, count});
    longest = std::max(longest, count);
}

void TokenSets::pad(uint32_t null_label)
{
    const std::vector<CellIndex> nowhere(round_up(rows(), kRowAlignment) - rows());
    if (nowhere.empty())
        tiles.insert(tiles.end(), 4, 0);
    else
        add(nowhere, std::vector<uint32_t>(nowhere.size(), null_label));
}

} // namespace semrover
