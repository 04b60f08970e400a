// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = residual + gate[gate_row[row], gate_col + group * gate_step + col] * x: [groups * M, N] -> [groups * M, N]
#include "kernels/network.h"

#include "gated_add.spv.h"

namespace semrover {

Tensor gated_add(Graph& g, Tensor x, Modulation gate, Tensor residual, uint32_t groups)
{
    SR_ASSERT(residual.rows == x.rows && residual.cols == x.cols, "gated_add: [{}, {}] onto [{}, {}]", x.rows, x.cols,
              residual.rows, residual.cols);
    SR_ASSERT(x.rows % groups == 0 && gate.table_row.rows == x.rows, "gated_add: {} rows, {} groups, {} table rows",
              x.rows, groups, gate.table_row.rows);
    const Tensor y = g.matrix(x.rows, x.cols, residual.dtype, "gated_add");
    GatedAddPush push{};
    push.rows = x.rows / groups;
    push.cols = x.cols;
    push.groups = groups;
    push.x_ld = x.ld;
    push.y_ld = y.ld;
    push.residual_ld = residual.ld;
    push.gate_ld = gate.table.ld;
    push.gate_col = gate.col;
    push.gate_step = gate.step;
    DispatchOptions options;
    options.epilogue = "kGatedAdd";
    if (groups == 1)
        options.banded = {"X", "GateRow", "Residual", "Y"};
    g.dispatch(kernel::gated_add,
               {{"X", x}, {"Gate", gate.table}, {"GateRow", gate.table_row}, {"Residual", residual}, {"Y", y}}, push,
               threads(x.rows * divide_up(x.cols, 8)), std::move(options));
    return y;
}

} // namespace semrover
