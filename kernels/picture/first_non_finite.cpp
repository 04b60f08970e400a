// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// index of the first NaN or infinity: [padded pixels, N] -> [1]
#include "kernels/picture.h"

#include "first_non_finite.spv.h"
#include "kernels/sort.h"

namespace semrover {

Tensor first_non_finite(Graph& g, Tensor x, const PictureShape& s)
{
    SR_ASSERT(x.dtype == DType::f32 && x.rows >= s.padded_width * s.padded_height && s.padded_width >= s.width &&
                  s.padded_height >= s.height,
              "first_non_finite: [{}, {}] {} of {} x {} pixels", x.rows, x.cols, dtype_name(x.dtype), s.padded_width,
              s.padded_height);
    const Tensor first = fill(g, 1, ~0u);
    const FirstNonFinitePush push{.elements = s.width * s.height * x.cols,
                                  .cols = x.cols,
                                  .width = s.width,
                                  .x_width = s.padded_width,
                                  .x_ld = x.ld};
    g.dispatch(kernel::first_non_finite, {{"X", x}, {"First", first}}, push, threads(push.elements));
    return first;
}

} // namespace semrover
