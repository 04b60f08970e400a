// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = seen / 127.5 - 1: [P] -> [padded pixels, 3]
#include "kernels/picture.h"

#include "picture_input.spv.h"

namespace semrover {

FeatureMap picture_input(Graph& g, Tensor seen, const PictureShape& s)
{
    SR_ASSERT(seen.ld == 1 && seen.rows == s.width * s.height && s.padded_width >= s.width &&
                  s.padded_height >= s.height && s.width && s.height,
              "picture_input: {} words of {} x {} pixels, padded to {} x {}", seen.rows, s.width, s.height,
              s.padded_width, s.padded_height);
    const FeatureMap y = feature_map(g, 1, s.padded_height, s.padded_width, 3, DType::f32, "picture");
    const PictureInputPush push{.rows = y.data.rows,
                                .width = s.width,
                                .height = s.height,
                                .y_width = s.padded_width,
                                .y_height = s.padded_height,
                                .y_ld = y.data.ld};
    g.dispatch(kernel::picture_input, {{"Pixels", seen}, {"Y", y.data}}, push, threads(push.rows));
    return y;
}

} // namespace semrover
