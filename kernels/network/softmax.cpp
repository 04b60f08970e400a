// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(scale x) over the first `count` columns: [M, N] -> [M, N]
#include "kernels/network.h"

#include "softmax.spv.h"

#include <cmath>
#include <numbers>

namespace semrover {

Tensor softmax(Graph& g, Tensor x, const SoftmaxOptions& options)
{
    SR_ASSERT(options.count > 0 && options.count <= x.cols, "softmax: {} of {} columns", options.count, x.cols);
    const Tensor y = g.matrix(x.rows, x.cols, options.dtype, "softmax");
    SoftmaxPush push{};
    push.rows = x.rows;
    push.cols = options.count;
    push.width = round_up(x.cols, kRowPadding);
    push.x_ld = x.ld;
    push.y_ld = y.ld;
    push.scale = float(std::numbers::log2e * double(options.scale));
    DispatchOptions dispatch;
    dispatch.banded = {"X", "Y"};
    g.dispatch(kernel::softmax, {{"X", x}, {"Y", y}}, push, row_tiles(x.rows, 1), std::move(dispatch));
    return y;
}

} // namespace semrover
