#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (2 / 255 bilinear(image) - 1 - shift) / scale, a pixel a thread. Output pixel i lies at s = max((i + 1/2) in / out - 1/2, 0) of the
// input (align_corners = False, no antialiasing), and s = n / d with integers, so that its fraction is exact.
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(push_constant) uniform ResizeBilinearPush {
    uint rows; // of the output, all images, padding included
    uint first_row;
    uint in_height;
    uint in_width;
    uint in_words; // from one image to the next
    uint out_height;
    uint out_width;
    uint image_rows; // rows of an output image
    uint y_ld;
    float shift_r;
    float shift_g;
    float shift_b;
    float scale_r;
    float scale_g;
    float scale_b;
} p;
layout(binding = 0) readonly buffer Pixels { uint pixels[]; }; // [images, in_words], four bytes a word: RGB RGB ..
layout(binding = 1) writeonly buffer Y { uvec4 y[]; };         // [images * image_rows, y_ld]

struct Place {
    uint low, high; // pixels on either side
    float share;    // of the high one
};

Place place(uint i, uint size_in, uint size_out)
{
    const uint n = uint(max(int((2 * i + 1) * size_in) - int(size_out), 0)), d = 2 * size_out;
    const uint low = min(n / d, size_in - 1);
    return Place(low, min(low + 1, size_in - 1), float(n % d) / float(d));
}

vec3 texel(uint image, uint row, uint col)
{
    vec3 rgb;
    for (uint c = 0; c < 3; ++c) {
        const uint at = (row * p.in_width + col) * 3 + c;
        rgb[c] = float(pixels[image * p.in_words + at / 4] >> at % 4 * 8 & 0xffu);
    }
    return rgb;
}

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    const uint at = row + p.first_row, image = at / p.image_rows, pixel = at % p.image_rows;
    vec3 rgb = vec3(0.0);
    if (pixel < p.out_height * p.out_width) { // else a padding row
        const Place v = place(pixel / p.out_width, p.in_height, p.out_height);
        const Place u = place(pixel % p.out_width, p.in_width, p.out_width);
        const vec3 top = mix(texel(image, v.low, u.low), texel(image, v.low, u.high), u.share);
        const vec3 bottom = mix(texel(image, v.high, u.low), texel(image, v.high, u.high), u.share);
        rgb = mix(top, bottom, v.share) / 127.5 - 1.0;
        rgb = (rgb - vec3(p.shift_r, p.shift_g, p.shift_b)) / vec3(p.scale_r, p.scale_g, p.scale_b);
    }
    STORE8(y, kTypeY, row * p.y_ld, vec4(rgb, 0.0), vec4(0.0));
}
