// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// x' = c_x x + c_z z: [M, N], in place
#include "kernels/sampling.h"

#include "step_renoise.spv.h"

namespace semrover {

void step_renoise(Graph& g, StepTable steps, Tensor z, Tensor x)
{
    SR_ASSERT(z.rows == x.rows && z.ld == x.ld, "step_renoise: [{}, {}] and [{}, {}]", z.rows, z.ld, x.rows, x.ld);
    const StepRenoisePush push{.rows = x.rows, .ld = x.ld};
    g.dispatch(kernel::step_renoise, {{"Clock", steps.clock}, {"Steps", steps.rows}, {"Z", z}, {"X", x}}, push,
               threads(x.rows * (x.ld / 4)));
}

} // namespace semrover
