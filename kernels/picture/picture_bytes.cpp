// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// bytes = (x + 1) 127.5, four a word: [padded pixels, 3] -> [words]
#include "kernels/picture.h"

#include "picture_bytes.spv.h"

namespace semrover {

Tensor picture_bytes(Graph& g, Tensor x, const PictureShape& s)
{
    SR_ASSERT(x.dtype == DType::f32 && x.cols == 3 && x.rows >= s.padded_width * s.padded_height &&
                  s.padded_width >= s.width && s.padded_height >= s.height,
              "picture_bytes: [{}, {}] {} of {} x {} pixels", x.rows, x.cols, dtype_name(x.dtype), s.padded_width,
              s.padded_height);
    const Tensor y = g.array(picture_words(s.width, s.height), DType::u32, "bytes");
    const PictureBytesPush push{
        .words = y.rows, .width = s.width, .height = s.height, .x_width = s.padded_width, .x_ld = x.ld};
    g.dispatch(kernel::picture_bytes, {{"X", x}, {"Bytes", y}}, push, threads(y.rows));
    return y;
}

} // namespace semrover
