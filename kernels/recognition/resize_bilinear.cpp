// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (2 / 255 bilinear(image) - 1 - shift) / scale: images of bytes [images, H, W, 3] -> y [images, H', W', 3]
#include "kernels/recognition.h"

#include "resize_bilinear.spv.h"

namespace semrover {

FeatureMap resize_bilinear(Graph& g, Tensor pixels, const ResizeOptions& o)
{
    SR_ASSERT(pixels.dtype == DType::u32 && o.in_height && o.in_width && o.out_height && o.out_width &&
                  pixels.cols == rgb_words(o.in_height, o.in_width) && pixels.ld == pixels.cols,
              "resize_bilinear: [{}, {}] words for {}x{} pixels", pixels.rows, pixels.cols, o.in_height, o.in_width);
    const FeatureMap y = feature_map(g, pixels.rows, o.out_height, o.out_width, 3, o.dtype, "resized");
    ResizeBilinearPush push{};
    push.rows = y.data.rows;
    push.in_height = o.in_height;
    push.in_width = o.in_width;
    push.in_words = pixels.ld;
    push.out_height = o.out_height;
    push.out_width = o.out_width;
    push.image_rows = y.image_rows();
    push.y_ld = y.data.ld;
    push.shift_r = o.shift[0];
    push.shift_g = o.shift[1];
    push.shift_b = o.shift[2];
    push.scale_r = o.scale[0];
    push.scale_g = o.scale[1];
    push.scale_b = o.scale[2];
    DispatchOptions dispatch;
    dispatch.banded = {"Y"};
    g.dispatch(kernel::resize_bilinear, {{"Pixels", pixels}, {"Y", y.data}}, push, threads(push.rows),
               std::move(dispatch));
    return y;
}

} // namespace semrover
