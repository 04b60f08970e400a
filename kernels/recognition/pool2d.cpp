// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = max or mean of the pixels of a window that lie inside the image: x [images, H, W, C] -> y [images, H', W', C]
#include "kernels/recognition.h"

#include "pool2d.spv.h"

namespace semrover {

FeatureMap pool2d(Graph& g, FeatureMap x, const PoolOptions& o, const PartOf& part)
{
    SR_ASSERT(o.kernel_height > o.padding_y && o.kernel_width > o.padding_x && o.stride_y && o.stride_x &&
                  x.height + 2 * o.padding_y >= o.kernel_height && x.width + 2 * o.padding_x >= o.kernel_width,
              "pool2d: a window of {}x{} with padding {}, {} over {}x{} pixels", o.kernel_height, o.kernel_width,
              o.padding_y, o.padding_x, x.height, x.width);
    FeatureMap y{part.whole, x.batch, (x.height + 2 * o.padding_y - o.kernel_height) / o.stride_y + 1,
                 (x.width + 2 * o.padding_x - o.kernel_width) / o.stride_x + 1};
    y.data = part.valid() ? part.whole.row_range(part.row, y.batch * y.image_rows())
                          : g.matrix(y.batch * y.image_rows(), x.channels(), x.data.dtype, "pool2d");
    Pool2dPush push{};
    push.rows = y.batch * y.image_rows();
    push.width = round_up(x.channels(), kRowPadding);
    SR_ASSERT(part.col % 8 == 0 && part.col + push.width <= round_up(y.data.cols, 8),
              "pool2d: [{}, {}] written into [{}, {}] from column {}", push.rows, x.channels(), y.data.rows,
              y.data.cols, part.col);
    push.out_width = y.width;
    push.out_pixels = y.pixels();
    push.image_rows = y.image_rows();
    push.in_width = x.width;
    push.in_height = x.height;
    push.in_image_rows = x.image_rows();
    push.kernel_height = o.kernel_height;
    push.kernel_width = o.kernel_width;
    push.stride_y = o.stride_y;
    push.stride_x = o.stride_x;
    push.padding_y = o.padding_y;
    push.padding_x = o.padding_x;
    push.x_ld = x.data.ld;
    push.y_ld = y.data.ld;
    push.y_col = part.col;
    RowWindow window;
    window.out_width = y.width;
    window.out_height = y.height;
    window.out_image_rows = push.image_rows;
    window.in_width = x.width;
    window.in_height = x.height;
    window.in_image_rows = push.in_image_rows;
    window.stride = o.stride_y;
    window.padding = o.padding_y;
    window.kernel = o.kernel_height;
    DispatchOptions dispatch;
    dispatch.constants = {{"kMean", o.mean}};
    dispatch.banded = {{"X", window}, "Y"};
    g.dispatch(kernel::pool2d, {{"X", x.data}, {"Y", y.data}}, push, threads(push.rows * (push.width / 8)),
               std::move(dispatch));
    return y;
}

} // namespace semrover
