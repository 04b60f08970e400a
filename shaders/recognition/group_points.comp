#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = [point - center, features of the point], a row per member of a group, eight columns a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform GroupPointsPush {
    uint rows; // members of all groups
    uint first_row;
    uint neighbors; // members of a group
    uint features;  // columns
    uint features_ld;
    uint y_ld;
} p;
layout(binding = 0) readonly buffer Points { vec4 points[]; };      // [P] xyz
layout(binding = 1) readonly buffer Centers { vec4 centers[]; };    // [all rows / neighbors] xyz
layout(binding = 2) readonly buffer Features { float features[]; }; // [P, features_ld]
layout(binding = 3) readonly buffer Index { uint index[]; };        // [rows]
layout(binding = 4) writeonly buffer Y { vec4 y[]; };               // [rows, y_ld]

void main()
{
    const uint per_row = p.y_ld / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    const uint point = index[row];
    const vec3 offset = points[point].xyz - centers[(row + p.first_row) / p.neighbors].xyz;
    vec4 lo = vec4(0.0), hi = vec4(0.0);
    for (uint i = 0; i < 8; ++i) {
        const uint c = col + i;
        float v = 0.0;
        if (c < 3)
            v = offset[c];
        else if (c < 3 + p.features)
            v = features[point * p.features_ld + c - 3];
        if (i < 4)
            lo[i] = v;
        else
            hi[i - 4] = v;
    }
    y[(row * p.y_ld + col) / 4] = lo;
    y[(row * p.y_ld + col) / 4 + 1] = hi;
}
