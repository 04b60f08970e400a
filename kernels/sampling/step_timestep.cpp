// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// table_row[r] = steps[clock.row].timestep_index - clock.first_timestep: -> [rows]
#include "kernels/sampling.h"

#include "step_timestep.spv.h"

namespace semrover {

void step_timestep(Graph& g, StepTable steps, Tensor table_row)
{
    const StepTimestepPush push{.rows = table_row.rows};
    g.dispatch(kernel::step_timestep, {{"Clock", steps.clock}, {"Steps", steps.rows}, {"TableRow", table_row}}, push,
               threads(table_row.rows));
}

} // namespace semrover
