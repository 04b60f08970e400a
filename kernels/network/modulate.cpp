// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * (1 + scale) + shift: [groups * M, N] -> [groups * M, N]
#include "kernels/network.h"

#include "kernels/network/row_norm.h"
#include "modulate.spv.h"
#include "shaders/network/modulate.h"

namespace semrover {

Tensor modulate(Graph& g, Tensor x, Modulation shift, uint32_t scale_col, float eps, uint32_t groups)
{
    SR_ASSERT(x.rows % groups == 0 && shift.table_row.rows == x.rows, "modulate: {} rows, {} groups, {} table rows",
              x.rows, groups, shift.table_row.rows);
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, "modulate");
    ModulatePush push{};
    push.rows = x.rows / groups;
    push.cols = x.cols;
    push.groups = groups;
    push.x_ld = x.ld;
    push.y_ld = y.ld;
    push.table_ld = shift.table.ld;
    push.shift_col = shift.col;
    push.scale_col = scale_col;
    push.step = shift.step;
    push.eps = eps;
    const bool aligned = (shift.table.ld | shift.col | scale_col | shift.step) % 4 == 0;
    DispatchOptions options;
    options.variant = &g.variant(kernel::modulate);
    options.constants = {{"kKept", kept_sweeps(x.cols)}, {"kAligned", aligned}};
    if (groups == 1)
        options.banded = {"X", "TableRow", "Y"};
    g.dispatch(kernel::modulate, {{"X", x}, {"Table", shift.table}, {"TableRow", shift.table_row}, {"Y", y}}, push,
               row_tiles(x.rows, options.variant->value("kTileM")), std::move(options));
    return y;
}

} // namespace semrover
