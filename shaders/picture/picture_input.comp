#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// bytes to -1..1, a row of a feature map a thread; the picture goes on with its last column and row
#extension GL_GOOGLE_include_directive : require
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform PictureInputPush {
    uint rows;          // of y
    uint width, height; // of the picture
    uint y_width, y_height;
    uint y_ld;
} p;
layout(binding = 0) readonly buffer Pixels { uint pixels[]; }; // [height, width] red, green, blue in the low bytes
layout(binding = 1) writeonly buffer Y { vec4 y[]; };          // [rows, 3]

float number(uint byte)
{
    precise float v = divide(float(byte & 255u), 127.5) - 1.0;
    return v;
}

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    vec4 v = vec4(0.0);
    if (row < p.y_width * p.y_height) {
        const uint x = min(row % p.y_width, p.width - 1), line = min(row / p.y_width, p.height - 1);
        const uint pixel = pixels[line * p.width + x];
        v.xyz = vec3(number(pixel), number(pixel >> 8), number(pixel >> 16));
    }
    y[row * (p.y_ld / 4)] = v;
    for (uint i = 1; i < p.y_ld / 4; ++i)
        y[row * (p.y_ld / 4) + i] = vec4(0.0);
}
