// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

namespace semrover {

// the largest guidance scale; the least is 0
constexpr float kMaxGuidance = 1000;

// metres: a guidance radius that leaves the attention radius as it is
constexpr double kWholeRadius = 1000;

// the largest timestep that a schedule may have
constexpr int kLastTimestep = 10000;

// usage for a scale that is out of range, or no number
inline Status check_guidance(float scale)
{
    if (!(scale >= 0 && scale <= kMaxGuidance))
        return fail(ErrorCode::usage, "guidance scale {} is not in 0..{}", scale, kMaxGuidance);
    return {};
}

} // namespace semrover
