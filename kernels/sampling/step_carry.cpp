// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// d = sum over known frames k of weight[step, frame, k] (fixed_k - x0_k);  x0 += d;  x' += c_x0 d: [M, N], in place,
// where a frame is not known
#include "kernels/sampling.h"

#include "step_carry.spv.h"

namespace semrover {

void step_carry(Graph& g, StepTable steps, const FrameWeights& weights, Tensor known, Tensor fixed, Tensor x, Tensor x0)
{
    const uint32_t frames = weights.frames;
    SR_ASSERT(frames > 0 && x.rows % frames == 0 && weights.table.cols == frames && weights.table.ld == frames,
              "step_carry: {} rows of {} frames, weights [{}, {}]", x.rows, frames, weights.table.rows,
              weights.table.cols);
    SR_ASSERT(known.rows == x.rows && fixed.rows == x.rows && fixed.ld == x.ld && x0.ld == x.ld,
              "step_carry: {} known, fixed [{}, {}], x [{}, {}]", known.rows, fixed.rows, fixed.ld, x.rows, x.ld);
    const StepCarryPush push{
        .rows = x.rows, .ld = x.ld, .frames = frames, .frame_rows = x.rows / frames, .first_row = weights.first_row};
    g.dispatch(kernel::step_carry,
               {{"Clock", steps.clock},
                {"Steps", steps.rows},
                {"Weights", weights.table},
                {"Known", known},
                {"Fixed", fixed},
                {"X", x},
                {"X0", x0}},
               push, threads(x.rows * (x.ld / 4)));
}

} // namespace semrover
