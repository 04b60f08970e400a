// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// mean[chunk, c] and m2[chunk, c] = sum of (x - mean)^2 over the pixels of 16 rows: [images, H, W, C] ->
// [images * rows / 16, C, 2]
#include "kernels/network.h"

#include "channel_moments.spv.h"

namespace semrover {

Tensor channel_moments(Graph& g, FeatureMap x)
{
    const uint32_t chunks = x.data.rows / kImageRowPadding, width = round_up(x.channels(), kRowPadding);
    const Tensor moments = g.matrix(chunks, 2 * width, DType::f32, "moments");
    ChannelMomentsPush push{};
    push.rows = x.data.rows;
    push.cols = x.channels();
    push.x_ld = x.data.ld;
    push.moments_ld = moments.ld;
    push.moments_pixels = x.pixels();
    push.moments_image_rows = x.image_rows();
    DispatchOptions options;
    options.epilogue = "kMoments";
    options.keeps_x = true;
    options.banded = {"X", {"Moments", kImageRowPadding}};
    g.dispatch(kernel::channel_moments, {{"X", x.data}, {"Moments", moments}}, push, threads(chunks * (width / 8)),
               std::move(options));
    return moments;
}

} // namespace semrover
