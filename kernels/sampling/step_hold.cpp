// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// x = fixed where known: [M, N], in place
#include "kernels/sampling.h"

#include "step_hold.spv.h"

namespace semrover {

void step_hold(Graph& g, Tensor known, Tensor fixed, Tensor x)
{
    SR_ASSERT(fixed.rows == x.rows && fixed.ld == x.ld && known.rows == x.rows,
              "step_hold: {} known, [{}, {}], [{}, {}]", known.rows, fixed.rows, fixed.ld, x.rows, x.ld);
    const StepHoldPush push{.rows = x.rows, .ld = x.ld};
    g.dispatch(kernel::step_hold, {{"Known", known}, {"Fixed", fixed}, {"X", x}}, push, threads(x.rows * (x.ld / 4)));
}

} // namespace semrover
