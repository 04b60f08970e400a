// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = x / (1 + exp(-x)): [M, N] -> [M, N]
#include "kernels/network.h"

#include "silu.spv.h"

namespace semrover {

Tensor silu(Graph& g, Tensor x)
{
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, "silu");
    const uint32_t width = round_up(x.cols, kRowPadding);
    const SiluPush push{.rows = x.rows, .x_ld = x.ld, .y_ld = y.ld, .width = width};
    DispatchOptions options;
    options.absorbed_as = "kSilu";
    options.banded = {"X", "Y"};
    g.dispatch(kernel::silu, {x, y}, push, threads(x.rows * (width / 8)), std::move(options));
    return y;
}

} // namespace semrover
