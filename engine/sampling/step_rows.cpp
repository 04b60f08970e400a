// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/step_rows.h"

#include <algorithm>

namespace semrover {

StepRow step_row(const PlanRow& row)
{
    const StepCoefficients& c = row.coefficients;
    StepRow r{};
    r.in_scale = float(c.in_scale);
    r.x0_x = float(c.x0_x);
    r.x0_m = float(c.x0_m);
    r.c_x0 = float(c.c_x0);
    r.c_x = float(c.c_x);
    r.c_m = float(c.c_m);
    r.c_prev = float(c.c_prev);
    r.c_z = float(c.c_z);
    r.known_scale = float(c.known_scale);
    r.known_noise = float(c.known_noise);
    r.c_z_color = float(c.c_z_color.value_or(c.c_z));
    r.draw = row.draw;
    r.timestep_index = row.timestep_index;
    r.noise_stream = row.kind == PlanRowKind::undo ? 2 : 0;
    return r;
}

bool draws_noise(const SamplingPlan& plan)
{
    return std::ranges::any_of(plan.rows, [](const PlanRow& r) { return r.coefficients.c_z != 0; });
}

StepRow first_noise_row(double scale, uint32_t draw)
{
    StepRow r{};
    r.c_z = float(scale);
    r.draw = draw;
    r.noise_stream = 2;
    return r;
}

StepRow more_noise_row(double scale, uint32_t draw)
{
    StepRow r = first_noise_row(scale, draw);
    r.c_x = 1;
    return r;
}

} // namespace semrover
