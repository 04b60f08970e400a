#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// -1..1 to bytes, cut to the picture, three bytes a pixel without padding; four bytes a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform PictureBytesPush {
    uint words;         // of y
    uint width, height; // of the picture
    uint x_width;       // pixels from one line of x to the next
    uint x_ld;
} p;
layout(binding = 0) readonly buffer X { float x[]; };      // [rows, 3]
layout(binding = 1) writeonly buffer Bytes { uint bytes[]; }; // [words]

void main()
{
    const uint i = linear_thread();
    if (i >= p.words)
        return;
    uint word = 0;
    for (uint k = 0; k < 4; ++k) {
        const uint element = 4 * i + k, pixel = element / 3;
        if (pixel >= p.width * p.height)
            break;
        const uint row = pixel / p.width * p.x_width + pixel % p.width;
        precise float v = (x[row * p.x_ld + element % 3] + 1.0) * 127.5;
        word |= rounded(clamp(v, 0.0, 255.0)) << 8 * k;
    }
    bytes[i] = word;
}
