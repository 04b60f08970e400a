// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/sampling/repaint.h"
#include "shaders/lib/step_row.h"

namespace semrover {

// draws of the noise before a plan's first row; the rows' own are 0 up to kMaxPlanRows
constexpr uint32_t kFirstDraw = 0xfffff;         // the first noise
constexpr uint32_t kPreviousFrameDraw = 0xffffe; // the noise on the frame before

StepRow step_row(const PlanRow& row); // of a plan, for the device

// whether any row adds noise; else step_update takes any finite numbers for it
bool draws_noise(const SamplingPlan& plan);

// x = scale z, and x += scale z: rows for step_renoise, with noise of the stream of all tokens
StepRow first_noise_row(double scale, uint32_t draw);
StepRow more_noise_row(double scale, uint32_t draw);

} // namespace semrover
