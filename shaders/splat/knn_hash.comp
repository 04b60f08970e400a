#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// key[i] = hash of the grid cell of point i
#extension GL_GOOGLE_include_directive : require
#include "knn.h"
#include "lib/grid_hash.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { KnnPush p; };
layout(binding = 0) readonly buffer Points { float points[]; }; // [rows, points_ld]
layout(binding = 1) writeonly buffer Keys { uint keys[]; };     // [rows]

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const uint at = i * p.points_ld;
    keys[i] = grid_hash(grid_cell(vec3(points[at], points[at + 1], points[at + 2]), p.per_metre)) & p.mask;
}
