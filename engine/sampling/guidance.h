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

// Classifier-free guidance: m = u + scale (c - u), u without labels. Below timestep `from` and above `until` the
// network runs on c alone, which costs half: there guidance changes little (Kynkäänniemi et al. 2024, arXiv
// 2404.07724). With a `radius` voxels of u see no others beyond it, so that c - u is also what neighbors say of each
// other (docs/method.md §3.1).
struct Guidance {
    float scale = 4; // 1: no unconditional half
    double from = 0;
    double until = kLastTimestep;
    double radius = kWholeRadius; // metres; from the attention radius on it changes nothing

    bool narrows(double attention_radius) const { return radius < attention_radius; }
    bool at(double timestep) const { return scale != 1.f && timestep >= from && timestep <= until; }
};

// usage for a scale that is out of range, or no number
inline Status check_guidance(float scale)
{
    if (!(scale >= 0 && scale <= kMaxGuidance))
        return fail(ErrorCode::usage, "guidance scale {} is not in 0..{}", scale, kMaxGuidance);
    return {};
}

} // namespace semrover
