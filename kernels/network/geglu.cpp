// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[8j + i] = x[16j + i] gelu(x[16j + 8 + i]), i < 8: [M, 2N] -> [M, N]
#include "kernels/network.h"

#include "geglu.spv.h"

namespace semrover {

Tensor geglu(Graph& g, Tensor x)
{
    SR_ASSERT(x.cols % 16 == 0, "geglu: {} columns, expected a multiple of 16", x.cols);
    const Tensor y = g.matrix(x.rows, x.cols / 2, x.dtype, "geglu");
    const GegluPush push{.rows = x.rows, .cols = y.cols, .x_ld = x.ld, .y_ld = y.ld};
    DispatchOptions options;
    options.epilogue = "kGeglu";
    options.banded = {"X", "Y"};
    g.dispatch(kernel::geglu, {{"X", x}, {"Y", y}}, push, threads(x.rows * (y.cols / 8)), std::move(options));
    return y;
}

} // namespace semrover
