#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// keep[camera][splat] = can it be seen?
#extension GL_GOOGLE_include_directive : require
#include "splat.h"
#include "lib/splat_view.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(binding = 4) writeonly buffer Keep { uint keep[]; }; // [cameras, splats]

void main()
{
    const uint i = linear_thread();
    if (i >= p.cameras * p.splats)
        return;
    SplatView s;
    keep[i] = uint(view_splat(i % p.splats, i / p.splats, s));
}
