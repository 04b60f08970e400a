// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// bit j of row i: cell j of the set of i lies within the radius: cells [M, 4] -> [M, words]
#include "kernels/network.h"

#include "neighbor_mask.spv.h"

namespace semrover {

Tensor neighbor_mask(Graph& g, Tensor cells, Tensor sets, uint32_t longest_set, const NeighborRadius& radius)
{
    const uint32_t words = divide_up(longest_set, 32);
    const Tensor mask = g.array(cells.rows, DType::u32, "mask", words);
    const NeighborMaskPush push{.rows = cells.rows,
                                .words = words,
                                .radius2 = radius.radius2,
                                .near_row = radius.near_row,
                                .near_radius2 = radius.near_radius2};
    g.dispatch(kernel::neighbor_mask, {{"Cells", cells}, {"Sets", sets}, {"Mask", mask}}, push,
               threads(cells.rows * words));
    return mask;
}

} // namespace semrover
