// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v over the frames of a video, per pixel and head: [videos * frames * image_rows, 3 * heads *
// head_dim] -> [.., heads * head_dim]
#include "kernels/network.h"

#include "frame_attention.spv.h"

#include <cmath>
#include <numbers>

namespace semrover {

Tensor frame_attention(Graph& g, Tensor qkv, const FrameAttentionOptions& o)
{
    const uint32_t width = o.heads * o.head_dim, rows = o.frames * o.image_rows;
    SR_ASSERT(o.frames > 0 && o.frames <= kMostFrames && o.heads > 0 && o.head_dim > 0 && o.head_dim % 8 == 0,
              "frame_attention: {} frames, {} heads of {}", o.frames, o.heads, o.head_dim);
    SR_ASSERT(qkv.rows == o.videos * rows && qkv.cols == 3 * width,
              "frame_attention: [{}, {}] for {} videos of {} rows", qkv.rows, qkv.cols, o.videos, rows);
    const Tensor y = g.matrix(qkv.rows, width, qkv.dtype, "frame_attention");
    FrameAttentionPush push{};
    push.image_rows = o.image_rows;
    push.heads = o.heads;
    push.chunks = o.head_dim / 8;
    push.qkv_ld = qkv.ld;
    push.y_ld = y.ld;
    push.scale = float(std::numbers::log2e * (o.scale > 0 ? o.scale : 1 / std::sqrt(double(o.head_dim))));
    // a dispatch a video: a device that binds few bytes at once needs to bind one of them only
    for (uint32_t video = 0; video < o.videos; ++video) {
        DispatchOptions dispatch;
        dispatch.constants = {{"kFrames", o.frames}};
        dispatch.flops = 4.0 * o.frames * rows * width;
        g.dispatch(kernel::frame_attention,
                   {{"Qkv", qkv.row_range(video * rows, rows)}, {"Y", y.row_range(video * rows, rows)}}, push,
                   threads(rows * o.heads), std::move(dispatch));
    }
    return y;
}

} // namespace semrover
