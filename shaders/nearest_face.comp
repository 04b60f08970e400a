#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the nearest triangle of every point, ties to the lower index: rings of cells around the point's own, until none
// further out can be nearer. Closest point of a triangle: Ericson, Real-Time Collision Detection, section 5.1.5.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "nearest_face.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { NearestFacePush p; };
layout(binding = 0) readonly buffer Points { vec4 points[]; };    // [rows]
layout(binding = 1) readonly buffer Corners { vec4 corners[]; };  // [faces, 3]
layout(binding = 2) readonly buffer Starts { uint starts[]; };    // [cells + 1]
layout(binding = 3) readonly buffer Members { uint members[]; };  // faces of each cell
layout(binding = 4) writeonly buffer Nearest { uvec2 nearest[]; }; // [rows] distance as bits, face

const uint kNone = 0xffffffffu;

vec3 closest_point(vec3 q, vec3 a, vec3 b, vec3 c)
{
    const vec3 ab = b - a, ac = c - a, ap = q - a, bp = q - b, cp = q - c;
    const float d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
                d6 = dot(ac, cp);
    if (d1 <= 0.0 && d2 <= 0.0)
        return a;
    if (d3 >= 0.0 && d4 <= d3)
        return b;
    if (d6 >= 0.0 && d5 <= d6)
        return c;
    const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0)
        return a + ab * (d1 / (d1 - d3));
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0)
        return a + ac * (d2 / (d2 - d6));
    if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0)
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    const float sum = va + vb + vc;
    return sum > 0.0 ? a + ab * (vb / sum) + ac * (vc / sum) : a; // no area: an edge was nearest above
}

float best;
uint face;

void search(ivec3 cell, vec3 q)
{
    const uint id = (uint(cell.z) * p.cells_y + uint(cell.y)) * p.cells_x + uint(cell.x);
    for (uint i = starts[id]; i < starts[id + 1]; ++i) {
        const uint f = members[i];
        const vec3 d = q - closest_point(q, corners[3 * f].xyz, corners[3 * f + 1].xyz, corners[3 * f + 2].xyz);
        const float distance2 = dot(d, d);
        if (distance2 < best || (distance2 == best && f < face)) {
            best = distance2;
            face = f;
        }
    }
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const vec3 q = points[i].xyz;
    const ivec3 size = ivec3(p.cells_x, p.cells_y, p.cells_z);
    const vec3 at = (q - vec3(p.low_x, p.low_y, p.low_z)) / p.cell_size;
    const ivec3 own = ivec3(clamp(floor(at), vec3(0), vec3(size - 1)));
    best = p.radius * p.radius;
    face = kNone;
    const int rings = max(size.x, max(size.y, size.z));
    for (int ring = 0; ring < rings; ++ring) {
        const float certain = float(max(ring - 1, 0)) * p.cell_size * 0.9999; // of what lies in this ring
        if (certain * certain > best)
            break;
        const ivec3 low = max(own - ring, ivec3(0)), high = min(own + ring, size - 1);
        for (int z = low.z; z <= high.z; ++z)
            for (int y = low.y; y <= high.y; ++y) {
                const bool whole = abs(z - own.z) == ring || abs(y - own.y) == ring;
                if (whole) {
                    for (int x = low.x; x <= high.x; ++x)
                        search(ivec3(x, y, z), q);
                } else {
                    if (own.x - ring >= 0)
                        search(ivec3(own.x - ring, y, z), q);
                    if (own.x + ring < size.x)
                        search(ivec3(own.x + ring, y, z), q);
                }
            }
    }
    nearest[i] = uvec2(floatBitsToUint(sqrt(best)), face);
}
