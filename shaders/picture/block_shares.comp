#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// share of the visible pixels of a block, a block a thread; the picture goes on with its last column and row
#extension GL_GOOGLE_include_directive : require
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform BlockSharesPush {
    uint rows;          // of y
    uint width, height; // of the picture
    uint block;         // pixels on a side
    uint y_width, y_height;
} p;
layout(binding = 0) readonly buffer Pixels { uint pixels[]; }; // [height, width] visible: the high byte
layout(binding = 1) writeonly buffer Y { float y[]; };         // [rows]

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    if (row >= p.y_width * p.y_height) {
        y[row] = 0.0;
        return;
    }
    uint count = 0;
    for (uint i = 0; i < p.block * p.block; ++i) {
        const uint x = min(row % p.y_width * p.block + i % p.block, p.width - 1);
        const uint line = min(row / p.y_width * p.block + i / p.block, p.height - 1);
        count += pixels[line * p.width + x] >> 24 != 0 ? 1 : 0;
    }
    y[row] = divide(float(count), float(p.block * p.block));
}
