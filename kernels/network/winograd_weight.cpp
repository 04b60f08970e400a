// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// U = G w G^T: w [N, 9 * C] -> [36 * N, C] fp32
#include "kernels/network.h"

#include "winograd_weight.spv.h"

namespace semrover {

Tensor winograd_weight(Graph& g, Tensor w)
{
    const uint32_t cols = w.cols / 9;
    SR_ASSERT(w.cols % (9 * kRowPadding) == 0, "winograd_weight: {} columns for nine taps", w.cols);
    const Tensor u = g.matrix(36 * w.rows, cols, DType::f32, "winograd_weight");
    const WinogradWeightPush push{.outputs = w.rows, .cols = cols, .w_ld = w.ld, .u_ld = u.ld};
    g.dispatch(kernel::winograd_weight, {w, u}, push, threads(w.rows * (cols / 4)));
    return u;
}

} // namespace semrover
