#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = the voxel's part of x[i]: what lies above a triangle's place in the voxel
#extension GL_GOOGLE_include_directive : require
#include "lib/surface_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform PairCellsPush {
    uint size; // keys
} p;
layout(binding = 0) readonly buffer X { uint x[]; };  // [size]
layout(binding = 1) writeonly buffer Y { uint y[]; }; // [size]

void main()
{
    const uint i = linear_thread();
    if (i < p.size)
        y[i] = x[i] >> kPlaceBits;
}
