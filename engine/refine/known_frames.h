// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/sampling/repaint.h"

namespace semrover {

// How far known frames are off in a step's prediction says how far the others are off, too (docs/method.md §6.4). The
// weights of that for step_carry(), [rows of the plan, frames, frames]: of a row and frame, for each of the first
// `known` frames. They are those of frames that are Gaussian and whose correlation falls by `correlation` (0..1) from
// one to the next: cov(frame, known) cov(known, known)^-1, given the noisy frames.
std::vector<float> known_frame_weights(const SamplingPlan& plan, uint32_t frames, uint32_t known, double correlation);

} // namespace semrover
