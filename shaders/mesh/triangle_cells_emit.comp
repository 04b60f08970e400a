#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the pairs of triangle t, from first[t] on: a voxel's key, and below it the triangle's place in the voxel, so that
// sorted pairs of a voxel follow a Morton curve through it; the triangle
#extension GL_GOOGLE_include_directive : require
#include "lib/surface_record.glsl"
#include "lib/thread.glsl"
#include "lib/triangle_cells.glsl"
#include "triangle_cells.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TriangleCellsPush p; };
layout(binding = 0) readonly buffer Triangles { uint triangles[]; }; // [size, 12]
layout(binding = 1) readonly buffer First { uint first[]; };          // [size]
layout(binding = 2) writeonly buffer Keys { uint keys[]; };           // [capacity]
layout(binding = 3) writeonly buffer Values { uint values[]; };       // [capacity]

// x, y and z of 8 places along each axis, interleaved
uint morton(uvec3 place)
{
    uint code = 0;
    for (uint bit = 0; bit < kPlaceBits / 3; ++bit)
        for (uint axis = 0; axis < 3; ++axis)
            code |= (place[axis] >> bit & 1u) << (3 * bit + axis);
    return code;
}

void main()
{
    const uint t = linear_thread();
    if (t >= p.size)
        return;
    const vec3 a = RECORD_CORNER(triangles, t, 0), b = RECORD_CORNER(triangles, t, 1), c = RECORD_CORNER(triangles, t, 2);
    const vec3 low = min(min(a, b), c), high = max(max(a, b), c);
    const CellWalk w = walk_of(a, b, c, RECORD_RANGE(triangles, t));
    const uint base = RECORD_SLOT(triangles, t) * kBlockCells;
    uint at = first[t];
    for (int x = w.low.x; x <= w.high.x; ++x)
        for (int y = w.low.y; y <= w.high.y; ++y)
            for (int z = w.low.z; z <= w.high.z; ++z) {
                if (!touches(w, ivec3(x, y, z)) || at >= p.capacity)
                    continue;
                const vec3 cell = vec3(x, y, z), middle = 0.5 * (max(low, cell) + min(high, cell + 1.0)) - cell;
                const uint key = base + (uint(x) * kBlockEdge + uint(y)) * kBlockEdge + uint(z);
                keys[at] = key << kPlaceBits | morton(uvec3(clamp(8.0 * middle, 0.0, 7.0)));
                values[at++] = t;
            }
}
