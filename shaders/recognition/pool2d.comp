#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = max or mean of the pixels of a window that lie inside the image, eight channels a thread; a window without any is 0
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const bool kMean = false;
layout(push_constant) uniform Pool2dPush {
    uint rows; // of the output, all images, padding included
    uint first_row;
    uint x_first; // rows of x in front of the one that is bound first
    uint out_width;
    uint out_pixels; // of an image
    uint image_rows; // rows of an output image
    uint in_width;
    uint in_height;
    uint in_image_rows;
    uint kernel_height;
    uint kernel_width;
    uint stride_y;
    uint stride_x;
    uint padding_y; // above
    uint padding_x; // to the left
    uint x_ld;
    uint y_ld;
    uint y_col; // first column written, a multiple of 8
    uint width; // columns worked on, a multiple of 8
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };  // [images * in_image_rows, x_ld]
layout(binding = 1) writeonly buffer Y { uvec4 y[]; }; // [images * image_rows, y_ld]

void main()
{
    const uint per_row = p.width / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    const uint at = row + p.first_row, pixel = at % p.image_rows;
    vec4 lo = vec4(0.0), hi = vec4(0.0);
    if (pixel < p.out_pixels) { // else a padding row
        const ivec2 origin = ivec2(pixel / p.out_width * p.stride_y, pixel % p.out_width * p.stride_x) -
                             ivec2(p.padding_y, p.padding_x);
        const ivec2 begin = max(origin, ivec2(0));
        const ivec2 end = min(origin + ivec2(p.kernel_height, p.kernel_width), ivec2(p.in_height, p.in_width));
        const uint base = at / p.image_rows * p.in_image_rows - p.x_first;
        for (int i = begin.x; i < end.x; ++i)
            for (int j = begin.y; j < end.y; ++j) {
                vec4 a, b;
                LOAD8(x, kTypeX, (base + uint(i) * p.in_width + uint(j)) * p.x_ld + col, a, b);
                const bool first = i == begin.x && j == begin.y;
                lo = kMean ? lo + a : first ? a : max(lo, a);
                hi = kMean ? hi + b : first ? b : max(hi, b);
            }
        if (kMean) {
            const float share = 1.0 / float(max((end.x - begin.x) * (end.y - begin.y), 1));
            lo *= share;
            hi *= share;
        }
    }
    STORE8(y, kTypeY, row * p.y_ld + p.y_col + col, lo, hi);
}
