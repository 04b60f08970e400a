// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// gelu: y = 0.5 x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3))); silu: y = x / (1 + exp(-x)). [M, N] -> [M, N]
#include "kernels/network.h"

#include "gelu.spv.h"
#include "silu.spv.h"

namespace semrover {

namespace {

Tensor elementwise(Graph& g, const Kernel& kernel, Tensor x, const char* absorbed_as)
{
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, kernel.name);
    const uint32_t width = round_up(x.cols, kRowPadding);
    const ElementwisePush push{.rows = x.rows, .x_ld = x.ld, .y_ld = y.ld, .y_col = 0, .width = width};
    DispatchOptions options;
    options.absorbed_as = absorbed_as;
    options.banded = {"X", "Y"};
    g.dispatch(kernel, {{"X", x}, {"Y", y}}, push, threads(x.rows * (width / 8)), std::move(options));
    return y;
}

} // namespace

Tensor gelu(Graph& g, Tensor x)
{
    return elementwise(g, kernel::gelu, x, "kGelu");
}

Tensor silu(Graph& g, Tensor x)
{
    return elementwise(g, kernel::silu, x, "kSilu");
}

} // namespace semrover
