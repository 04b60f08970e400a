// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = x[i] >> kPlaceBits
#include "kernels/mesh.h"

#include "pair_cells.spv.h"

namespace semrover {

Tensor pair_cells(Graph& g, Tensor keys)
{
    SR_ASSERT(keys.dtype == DType::u32 && keys.ld == 1, "pair_cells: keys [{}, {}]", keys.rows, keys.cols);
    const Tensor y = g.array(keys.rows, DType::u32, "pair voxels");
    g.dispatch(kernel::pair_cells, {{"X", keys}, {"Y", y}}, PairCellsPush{.size = keys.rows}, threads(keys.rows));
    return y;
}

} // namespace semrover
