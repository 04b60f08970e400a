#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// counts[t] = how many voxels triangle t may have area in
#extension GL_GOOGLE_include_directive : require
#include "lib/surface_record.glsl"
#include "lib/thread.glsl"
#include "lib/triangle_cells.glsl"
#include "triangle_cells.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TriangleCellsPush p; };
layout(binding = 0) readonly buffer Triangles { uint triangles[]; }; // [size, 12]
layout(binding = 1) writeonly buffer Counts { uint counts[]; };       // [size]

void main()
{
    const uint t = linear_thread();
    if (t >= p.size)
        return;
    const CellWalk w = walk_of(RECORD_CORNER(triangles, t, 0), RECORD_CORNER(triangles, t, 1),
                               RECORD_CORNER(triangles, t, 2), RECORD_RANGE(triangles, t));
    uint n = 0;
    for (int x = w.low.x; x <= w.high.x; ++x)
        for (int y = w.low.y; y <= w.high.y; ++y)
            for (int z = w.low.z; z <= w.high.z; ++z)
                n += uint(touches(w, ivec3(x, y, z)));
    counts[t] = n;
}
