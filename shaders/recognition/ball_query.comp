#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the first points of the center's set, in their order, within the radius of it (d^2 <= r^2); where there are fewer, the
// first of them again and again; where there is none, the set's first point. A thread has a center.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform BallQueryPush {
    uint rows;    // centers of all sets
    uint count;   // points of a set
    uint samples; // centers of a set
    uint neighbors;
    float radius2;
} p;
layout(binding = 0) readonly buffer Points { vec4 points[]; };   // [sets * count] xyz
layout(binding = 1) readonly buffer Centers { vec4 centers[]; }; // [rows] xyz
layout(binding = 2) writeonly buffer Index { uint index[]; };    // [rows, neighbors] of points, over all sets

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    const uint first = row / p.samples * p.count;
    const vec3 center = centers[row].xyz;
    uint found = 0, pad = first;
    for (uint i = 0; i < p.count && found < p.neighbors; ++i) {
        const vec3 d = points[first + i].xyz - center;
        if (dot(d, d) > p.radius2)
            continue;
        pad = found == 0 ? first + i : pad;
        index[row * p.neighbors + found] = first + i;
        ++found;
    }
    for (; found < p.neighbors; ++found)
        index[row * p.neighbors + found] = pad;
}
