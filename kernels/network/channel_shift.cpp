// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = x + shift[shift_row[image], col + channel]: [images, H, W, N] -> [images, H, W, N]
#include "kernels/network.h"

#include "channel_shift.spv.h"

namespace semrover {

FeatureMap channel_shift(Graph& g, FeatureMap x, const ChannelShift& shift)
{
    SR_ASSERT(shift.table_row.rows == x.batch && shift.table.dtype == DType::f32 && shift.col % 4 == 0 &&
                  shift.col + round_up(x.channels(), kRowPadding) <= shift.table.ld,
              "channel_shift: columns {} + {} of a table of {}, {} table rows for {} images", shift.col, x.channels(),
              shift.table.ld, shift.table_row.rows, x.batch);
    const FeatureMap y = x.with(g.matrix(x.data.rows, x.channels(), x.data.dtype, "channel_shift"));
    ChannelShiftPush push{};
    push.rows = x.data.rows;
    push.cols = x.channels();
    push.image_rows = x.image_rows();
    push.x_ld = x.data.ld;
    push.y_ld = y.data.ld;
    push.shift_ld = shift.table.ld;
    push.shift_col = shift.col;
    DispatchOptions options;
    options.epilogue = "kShift";
    options.banded = {"X", "Y"};
    g.dispatch(kernel::channel_shift,
               {{"X", x.data}, {"Shift", shift.table}, {"ShiftRow", shift.table_row}, {"Y", y.data}}, push,
               threads(x.data.rows * divide_up(x.channels(), 8)), std::move(options));
    return y;
}

} // namespace semrover
