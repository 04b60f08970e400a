// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = 0.5 x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3))): [M, N] -> [M, N]
#include "kernels/network.h"

#include "gelu.spv.h"

namespace semrover {

Tensor gelu(Graph& g, Tensor x)
{
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, "gelu");
    const uint32_t width = round_up(x.cols, kRowPadding);
    const GeluPush push{.rows = x.rows, .x_ld = x.ld, .y_ld = y.ld, .width = width};
    DispatchOptions options;
    options.absorbed_as = "kGelu";
    options.banded = {"X", "Y"};
    g.dispatch(kernel::gelu, {x, y}, push, threads(x.rows * (width / 8)), std::move(options));
    return y;
}

} // namespace semrover
