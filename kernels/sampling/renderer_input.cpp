// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = [in_scale x, previous, buffer, visible], then, with two halves, [in_scale x, 0, buffer, 0]: -> [halves * M, 3C +
// 1]; without previous: -> [halves * M, 2C + 1]
#include "kernels/sampling.h"

#include "renderer_input.spv.h"

namespace semrover {

Tensor renderer_input(Graph& g, StepTable steps, Tensor x, const RendererFrame& frame, uint32_t halves, DType dtype)
{
    const bool previous = frame.previous.valid();
    for (const Tensor& latent : {previous ? frame.previous : frame.buffer, frame.buffer})
        SR_ASSERT(latent.rows == x.rows && latent.cols == x.cols && latent.ld == x.ld && latent.dtype == DType::f32,
                  "renderer_input: x [{}, {}], latent [{}, {}]", x.rows, x.cols, latent.rows, latent.cols);
    SR_ASSERT(x.dtype == DType::f32 && frame.visible.dtype == DType::f32 && frame.visible.rows == x.rows,
              "renderer_input: {} rows, {} of visibility; all are fp32", x.rows, frame.visible.rows);
    const Tensor y = g.matrix(halves * x.rows, (previous ? 3 : 2) * x.cols + 1, dtype, "renderer_input");
    RendererInputPush push{};
    push.rows = y.rows;
    push.x_rows = x.rows;
    push.channels = x.cols;
    push.latent_ld = x.ld;
    push.visible_ld = frame.visible.ld;
    push.y_ld = y.ld;
    push.latents = previous ? 3 : 2;
    g.dispatch(kernel::renderer_input,
               {{"Clock", steps.clock},
                {"Steps", steps.rows},
                {"X", x},
                {"Previous", frame.previous},
                {"Latent", frame.buffer},
                {"Visible", frame.visible},
                {"Y", y}},
               push, threads(y.rows * (y.ld / 8)));
    return y;
}

} // namespace semrover
