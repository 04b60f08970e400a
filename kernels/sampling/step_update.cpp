// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// m = u + guidance (c - u);  x0 = clamp(x0_x x + x0_m m, -clip, clip)
// x' = c_x0 x0 + c_x x + c_m m + c_prev x0_prev + c_z z;  known tokens: x' = known_scale fixed + known_noise z
#include "kernels/sampling.h"

#include "step_update.spv.h"

namespace semrover {

void step_update(Graph& g, StepTable steps, Tensor m, Tensor z, Tensor known, Tensor fixed, Tensor x, Tensor x0,
                 const FrameGuidance& guidance, float clip)
{
    const uint32_t guided = m.rows == 2 * x.rows;
    SR_ASSERT((guided || m.rows == x.rows) && m.ld == x.ld && z.ld == x.ld && fixed.ld == x.ld && x0.ld == x.ld,
              "step_update: m [{}, {}], x [{}, {}]", m.rows, m.ld, x.rows, x.ld);
    SR_ASSERT(guidance.frames > 0 && x.rows % guidance.frames == 0, "step_update: {} rows of {} frames", x.rows,
              guidance.frames);
    StepUpdatePush push{};
    push.rows = x.rows;
    push.ld = x.ld;
    push.guided = guided;
    push.guidance = guidance.first;
    push.guidance_step = guidance.frames > 1 ? (guidance.last - guidance.first) / float(guidance.frames - 1) : 0.f;
    push.frame_rows = x.rows / guidance.frames;
    push.clip = clip;
    g.dispatch(kernel::step_update,
               {{"Clock", steps.clock},
                {"Steps", steps.rows},
                {"M", m},
                {"Z", z},
                {"Known", known},
                {"Fixed", fixed},
                {"X", x},
                {"X0", x0}},
               push, threads(x.rows * (x.ld / 4)));
}

} // namespace semrover
