#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// bit j of row i: cell j of i's set lies within the radius, di^2 + dj^2 + dk^2 <= radius2; 32 keys a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform NeighborMaskPush {
    uint rows;
    uint words;    // of a row of the mask
    int radius2;   // largest squared distance, in cells
    uint near_row; // rows from here on have near_radius2
    int near_radius2;
} p;
layout(binding = 0) readonly buffer Cells { ivec4 cells[]; };   // [rows] i, j, k, unused
layout(binding = 1) readonly buffer Sets { uvec2 sets[]; };     // [rows] first row and number of rows of the row's set
layout(binding = 2) writeonly buffer Mask { uint mask[]; };     // [rows, words]

const int kFar = 26754; // 3 kFar^2 < 2^31: cells further apart must not wrap into the radius

void main()
{
    const uint row = linear_thread() / p.words, word = linear_thread() % p.words;
    if (row >= p.rows)
        return;
    const uvec2 set = sets[row];
    const ivec3 own = cells[row].xyz;
    uint bits = 0;
    for (uint b = 0; b < 32; ++b) {
        const uint j = word * 32 + b;
        if (j >= set.y)
            break;
        const ivec3 d = min(abs(cells[set.x + j].xyz - own), kFar);
        if (d.x * d.x + d.y * d.y + d.z * d.z <= (row < p.near_row ? p.radius2 : p.near_radius2))
            bits |= 1u << b;
    }
    mask[row * p.words + word] = bits;
}
