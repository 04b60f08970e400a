#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// keep[camera][splat] = can it be seen?
#extension GL_GOOGLE_include_directive : require
#include "splat.h"

layout(binding = 9) readonly buffer Rows { vec4 rows[]; }; // [height] of a sweep: splat.h; else anything
#include "lib/splat_lens_view.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 1) const bool kBlocks = false;
layout(binding = 7) writeonly buffer Keep { uint keep[]; };   // [cameras, splats]
layout(binding = 8) readonly buffer Blocks { uint blocks[]; }; // [splats / 64], or anything without kBlocks

void main()
{
    const uint i = linear_thread();
    if (i >= p.cameras * p.splats)
        return;
    const uint splat = i % p.splats;
    if (kBlocks && blocks[splat / 64] == 0) {
        keep[i] = 0;
        return;
    }
    LensView s;
    keep[i] = uint(view_splat(splat, i / p.splats, s));
}
