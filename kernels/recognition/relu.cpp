// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = max(x, 0): [M, N] -> [M, N], or columns of a wider tensor
#include "kernels/network.h"

#include "relu.spv.h"

namespace semrover {

Tensor relu(Graph& g, Tensor x, const PartOf& part)
{
    const uint32_t width = round_up(x.cols, kRowPadding);
    const Tensor y = part.valid() ? part.whole.row_range(part.row, x.rows) : g.matrix(x.rows, x.cols, x.dtype, "relu");
    SR_ASSERT(part.col % 8 == 0 && part.col + width <= round_up(y.cols, kRowPadding),
              "relu: [{}, {}] written into [{}, {}] from column {}", x.rows, x.cols, y.rows, y.cols, part.col);
    const ElementwisePush push{.rows = x.rows, .x_ld = x.ld, .y_ld = y.ld, .y_col = part.col, .width = width};
    DispatchOptions options;
    options.absorbed_as = "kRelu";
    options.banded = {"X", "Y"};
    g.dispatch(kernel::relu, {{"X", x}, {"Y", y}}, push, threads(x.rows * (width / 8)), std::move(options));
    return y;
}

} // namespace semrover
