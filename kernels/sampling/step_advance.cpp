// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// clock.row += 1
#include "kernels/sampling.h"

#include "step_advance.spv.h"

namespace semrover {

void step_advance(Graph& g, Tensor clock)
{
    g.dispatch(kernel::step_advance, {{"Clock", clock}}, groups(1));
}

} // namespace semrover
