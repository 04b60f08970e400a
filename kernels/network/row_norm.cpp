// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * scale + shift: [groups * M, N] -> [groups * M, N].
// layer_norm: scale and shift are its weight and bias; modulate: 1 + columns of a table, and columns of it
#include "kernels/network.h"

#include "row_norm.spv.h"
#include "shaders/network/row_norm.h"

#include <algorithm>

namespace semrover {

namespace {

// sweeps of 128 columns of a row that row_norm.simt.comp keeps in registers. With ten a thread of fp32 rows takes about
// 110 of them; longer rows read the rest again.
constexpr uint32_t kept_sweeps(uint32_t cols)
{
    return std::min(divide_up(cols, 128), 10u);
}

// table_row: none where all rows of x have row 0 of scale and shift
struct Affine {
    Tensor scale, shift, table_row;
};

Tensor row_norm(Graph& g, Tensor x, const Affine& affine, RowNormPush push, std::string_view name)
{
    const bool modulated = affine.table_row.valid();
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, name);
    push.rows = x.rows / push.groups;
    push.cols = x.cols;
    push.x_ld = x.ld;
    push.y_ld = y.ld;
    push.table_ld = affine.scale.ld;
    const bool aligned = (push.table_ld | push.shift_col | push.scale_col | push.step) % 4 == 0;
    DispatchOptions options;
    options.variant = &g.variant(kernel::row_norm);
    options.constants = {{"kKept", kept_sweeps(x.cols)}, {"kModulated", modulated}, {"kAligned", aligned}};
    if (push.groups == 1)
        options.banded = {"X", "Y"};
    if (push.groups == 1 && modulated)
        options.banded.push_back("TableRow");
    g.dispatch(kernel::row_norm,
               {{"X", x}, {"Scale", affine.scale}, {"Shift", affine.shift}, {"TableRow", affine.table_row}, {"Y", y}},
               push, row_tiles(x.rows, options.variant->value("kTileM")), std::move(options));
    return y;
}

} // namespace

Tensor layer_norm(Graph& g, Tensor x, Tensor weight, Tensor bias, float eps)
{
    SR_ASSERT(weight.cols == x.cols && bias.cols == x.cols && weight.dtype == DType::f32 && bias.dtype == DType::f32,
              "layer_norm: rows of {}, weight of {}, bias of {}", x.cols, weight.cols, bias.cols);
    RowNormPush push{};
    push.groups = 1;
    push.eps = eps;
    return row_norm(g, x, {weight, bias, {}}, push, "layer_norm");
}

Tensor modulate(Graph& g, Tensor x, Modulation shift, uint32_t scale_col, float eps, uint32_t groups)
{
    SR_ASSERT(x.rows % groups == 0 && shift.table_row.rows == x.rows, "modulate: {} rows, {} groups, {} table rows",
              x.rows, groups, shift.table_row.rows);
    RowNormPush push{};
    push.groups = groups;
    push.shift_col = shift.col;
    push.scale_col = scale_col;
    push.step = shift.step;
    push.eps = eps;
    return row_norm(g, x, {shift.table, shift.table, shift.table_row}, push, "modulate");
}

} // namespace semrover
