#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// normal and size of a point's splat: sigma, or spacing sqrt((d1^2 + d2^2 + d3^2) / 3), d the distances of its nearest
// three points, within limits
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform SplatShapePush {
    uint rows;      // points
    uint neighbors; // of a point
    float sigma;    // metres
    float spacing;  // sigma = spacing times the distance of the nearest points; 0: always `sigma`
    float smallest; // of such a sigma, metres
    float largest;
} p;
layout(binding = 0) readonly buffer Points { vec4 points[]; };       // [rows] xyz, opacity
layout(binding = 1) buffer Colors { vec4 colors[]; };                // [rows] rgb, sigma
layout(binding = 2) readonly buffer Neighbors { uint neighbors[]; }; // [rows, neighbors] nearest first
layout(binding = 3) readonly buffer Planes { vec4 planes[]; };       // [rows] normal
layout(binding = 4) writeonly buffer Normals { vec4 normals[]; };    // [rows] normal, sigma

const uint kNone = 0xffffffffu;

float spaced_sigma(uint row)
{
    float sum = 0.0, n = 0.0;
    for (uint q = 0; q < p.neighbors; ++q) {
        const uint j = neighbors[row * p.neighbors + q];
        if (j == kNone || j == row || n == 3.0)
            continue;
        const vec3 d = points[j].xyz - points[row].xyz;
        sum += dot(d, d);
        n += 1.0;
    }
    return n > 0.0 ? clamp(p.spacing * sqrt(sum / n), p.smallest, p.largest) : p.sigma;
}

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    float sigma = p.sigma;
    if (p.spacing > 0.0)
        sigma = spaced_sigma(row);
    normals[row] = vec4(planes[row].xyz, sigma);
    colors[row].w = sigma;
}
