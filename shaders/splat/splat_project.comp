#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the records of the splats that are kept, without gaps, in the order of cameras and splats; the sort key is the bits
// of the depth, which rise with it
#extension GL_GOOGLE_include_directive : require
#include "splat.h"
#include "lib/splat_view.glsl"
#include "lib/splat_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(binding = 7) readonly buffer Keep { uint keep[]; };          // [cameras, splats]
layout(binding = 8) readonly buffer Slots { uint slots[]; };        // [cameras, splats] kept ones before this one
layout(binding = 9) writeonly buffer Records { uvec4 records[]; };  // [max_visible, kRecord]
layout(binding = 10) writeonly buffer Sources { uint sources[]; };   // [max_visible] camera * splats + splat
layout(binding = 11) writeonly buffer Depths { uint depths[]; };     // [max_visible]

void main()
{
    const uint i = linear_thread();
    if (i >= p.cameras * p.splats || keep[i] == 0 || slots[i] >= p.max_visible)
        return;
    const uint splat = i % p.splats, slot = slots[i];
    SplatView s;
    view_splat(splat, i / p.splats, s);
    const float det = s.a.x * s.b.y - s.a.y * s.b.x;
    vec4 m = vec4(1e18, 0.0, 0.0, 1e18); // edge on: only the screen filter's dot remains
    vec2 g = vec2(0.0);
    if (abs(det) > 1e-5 * length(s.a) * length(s.b)) {
        m = vec4(s.b.y, -s.a.y, -s.b.x, s.a.x) / det;
        g = -vec2(m.x * s.u.z + m.z * s.v.z, m.y * s.u.z + m.w * s.v.z) / s.center.z;
    }
    const uvec2 bounds = uvec2(s.bounds.x | s.bounds.y << 16, s.bounds.z | s.bounds.w << 16);
    records[slot * kRecord] = uvec4(floatBitsToUint(s.pixel), bounds);
    records[slot * kRecord + 1] = floatBitsToUint(m);
    records[slot * kRecord + 2] = floatBitsToUint(vec4(g, s.center.z, positions[splat].w));
    records[slot * kRecord + 3] = floatBitsToUint(vec4(colors[splat].rgb, pack_normal(s.normal)));
    sources[slot] = i;
    depths[slot] = floatBitsToUint(s.center.z);
}
