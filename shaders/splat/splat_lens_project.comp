#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the records of the splats that are kept, without gaps, in the order of cameras and splats; the sort key is the bits
// of the depth (opencv: along z; others: from the camera), which rise with it
#extension GL_GOOGLE_include_directive : require
#include "splat.h"

layout(binding = 12) readonly buffer Rows { vec4 rows[]; }; // [height] of a sweep: splat.h; else anything
#include "lib/splat_lens_view.glsl"
#include "lib/splat_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(binding = 7) readonly buffer Keep { uint keep[]; };         // [cameras, splats]
layout(binding = 8) readonly buffer Slots { uint slots[]; };       // [cameras, splats] kept ones before this one
layout(binding = 9) writeonly buffer Records { uvec4 records[]; }; // [max_visible, kTexels]
layout(binding = 10) writeonly buffer Sources { uint sources[]; };  // [max_visible] camera * splats + splat
layout(binding = 11) writeonly buffer Depths { uint depths[]; };    // [max_visible]

const uint kTexels = kMoving ? kMovingRecord : kRayRecord;

void main()
{
    const uint i = linear_thread();
    if (i >= p.cameras * p.splats || keep[i] == 0 || slots[i] >= p.max_visible)
        return;
    const uint splat = i % p.splats, camera = i / p.splats, slot = slots[i];
    LensView s;
    view_splat(splat, camera, s);
    const uvec2 bounds = uvec2(s.bounds.x | s.bounds.y << 16, s.bounds.z | s.bounds.w << 16);
    // of a ray r: u = a . r / n . r, v = b . r / n . r, at the distance n . center / n . r
    vec4 a = vec4(cross(s.t_v, s.center) / normals[splat].w, positions[splat].w);
    const float plane = dot(s.normal, s.center), edge = abs(plane) > 1e-5 * s.away ? plane : 0.0;
    vec4 b = vec4(cross(s.center, s.t_u) / colors[splat].w, edge);
    if (kMoving) {
        a.xyz = s.t_u / normals[splat].w;
        b = vec4(s.center, normals[splat].w / colors[splat].w);
    }
    const uint at = slot * kTexels;
    records[at] = uvec4(floatBitsToUint(s.pixel), bounds);
    records[at + 1] = floatBitsToUint(a);
    records[at + 2] = floatBitsToUint(b);
    records[at + 3] = floatBitsToUint(vec4(s.normal, s.depth));
    records[at + 4] = floatBitsToUint(vec4(colors[splat].rgb, 0.0));
    if (kMoving)
        records[at + 5] = floatBitsToUint(vec4(s.drift, 0.0));
    sources[slot] = i;
    depths[slot] = floatBitsToUint(s.nearness);
}
