#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what each ray hits first, or, kAny, whether it hits anything
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kAny = false;
layout(push_constant) uniform TraceRaysPush {
    uint rows; // rays
} p;
layout(binding = 0) readonly buffer Nodes { uvec4 nodes[]; };        // [nodes, 4]
layout(binding = 1) readonly buffer Triangles { vec4 triangles[]; }; // [triangles, 3]
layout(binding = 2) readonly buffer Rays { vec4 rays[]; };           // [rows, 2] origin, near; direction, far
layout(binding = 3) writeonly buffer Hits { uvec4 hits[]; };         // [rows] t, u, v as bits; triangle

#include "lib/bvh.glsl"

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const vec4 from = rays[2 * i], along = rays[2 * i + 1];
    const Hit hit = trace(Ray(from.xyz, along.xyz, from.w, along.w), kAny);
    hits[i] = uvec4(floatBitsToUint(vec3(hit.t, hit.u, hit.v)), hit.triangle);
}
