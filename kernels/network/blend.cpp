// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = x + share (z - x): [M, N] -> [M, N]
#include "kernels/network.h"

#include "blend.spv.h"

namespace semrover {

Tensor blend(Graph& g, Tensor x, Tensor z, Tensor share)
{
    SR_ASSERT(z.rows == x.rows && z.cols == x.cols && share.rows == 1 && share.cols == 1 && share.dtype == DType::f32,
              "blend: [{}, {}] and [{}, {}], share [{}, {}]", x.rows, x.cols, z.rows, z.cols, share.rows, share.cols);
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, "blend");
    const BlendPush push{.rows = x.rows, .cols = x.cols, .x_ld = x.ld, .z_ld = z.ld, .y_ld = y.ld};
    DispatchOptions options;
    options.banded = {"X", "Z", "Y"};
    g.dispatch(kernel::blend, {{"X", x}, {"Z", z}, {"Share", share}, {"Y", y}}, push,
               threads(x.rows * divide_up(x.cols, 8)), std::move(options));
    return y;
}

} // namespace semrover
