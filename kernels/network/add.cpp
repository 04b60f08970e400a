// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = residual + x: [M, N] -> [M, N]
#include "kernels/network.h"

#include "add.spv.h"

namespace semrover {

Tensor add(Graph& g, Tensor x, Tensor residual, const PartOf& part)
{
    SR_ASSERT(residual.rows == x.rows && residual.cols == x.cols, "add: [{}, {}] onto [{}, {}]", x.rows, x.cols,
              residual.rows, residual.cols);
    const Tensor y = part.valid() ? part.of(x.rows, x.cols) : g.matrix(x.rows, x.cols, residual.dtype, "add");
    const AddPush push{.rows = x.rows, .cols = x.cols, .x_ld = x.ld, .y_ld = y.ld, .residual_ld = residual.ld};
    DispatchOptions options;
    options.epilogue = "kAdd";
    options.banded = {"X", "Residual", "Y"};
    g.dispatch(kernel::add, {{"X", x}, {"Residual", residual}, {"Y", y}}, push, threads(x.rows * divide_up(x.cols, 8)),
               std::move(options));
    return y;
}

} // namespace semrover
