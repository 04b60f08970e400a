// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (1 - share) now + share past where both frames show the same surface; past: bicubic (Catmull-Rom), cut to the
// mean of the 3 x 3 pixels of `now` plus and minus `spread` standard deviations
#include "kernels/picture.h"

#include "accumulate.spv.h"

namespace semrover {

Tensor accumulate(Graph& g, Tensor cameras, const FrameAndDepth& now, const FrameAndDepth& past,
                  const AccumulateOptions& o)
{
    const uint32_t pixels = o.width * o.height, words = picture_words(o.width, o.height);
    SR_ASSERT(cameras.rows == 2 && cameras.ld == kLensCameraFloats && now.bytes.rows == words &&
                  past.bytes.rows == words && now.depth.rows == pixels && past.depth.rows == pixels,
              "accumulate: {} x {} pixels, {} and {} words, {} and {} depths, {} cameras of {}", o.width, o.height,
              now.bytes.rows, past.bytes.rows, now.depth.rows, past.depth.rows, cameras.rows, cameras.ld);
    const Tensor y = g.array(words, DType::u32, "accumulated bytes");
    const AccumulatePush push{.width = o.width,
                              .height = o.height,
                              .words = words,
                              .share = o.share,
                              .tolerance = o.tolerance,
                              .spread = o.spread};
    g.dispatch(kernel::accumulate,
               {{"Cameras", cameras},
                {"Now", now.bytes},
                {"Past", past.bytes},
                {"DepthNow", now.depth},
                {"DepthPast", past.depth},
                {"Result", y}},
               push, threads(divide_up(pixels, 4u)),
               {.constants = {{"kModel", uint32_t(o.lens)}, {"kMoving", o.moving}}});
    return y;
}

} // namespace semrover
