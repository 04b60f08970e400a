// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// which pixel of a camera that moves during its readout shows a point; engine/camera/camera_view.h does the same on the
// host
#include "lib/lens.glsl"
#include "lib/moving_rays.glsl"

const float kSettled = 2e-5; // parts

// the part at which the line is read that shows a point then, from a guess within [low, high], and its pixel; lines
// before the first and after the last are read with those. False: none is found
bool settle(uint model, Lens l, Motion m, vec3 point, float low, float high, inout float part, out vec2 pixel)
{
    float before = part, off_before = 0.0;
    for (uint i = 0; i < 8; ++i) {
        if (!lens_project(model, l, seen_at(m, part, point), pixel))
            return false;
        const float off = clamp(part_of(m, pixel), low, high) - part;
        if (abs(off) <= kSettled)
            return true;
        float slope = i == 0 ? -1.0 : (off - off_before) / (part - before); // secants
        if (!(abs(slope) > 0.02))
            slope = -1.0;
        before = part;
        off_before = off;
        part = clamp(part - off / slope, low, high);
        if (part == before)
            return false;
    }
    return false;
}
