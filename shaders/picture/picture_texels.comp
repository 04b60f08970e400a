#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// three bytes a pixel to four, as images have them; one pixel a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform PictureTexelsPush {
    uint pixels;
} p;
layout(binding = 0) readonly buffer Bytes { uint bytes[]; };    // [words] red, green, blue, without padding
layout(binding = 1) writeonly buffer Texels { uint texels[]; }; // [pixels] red, green, blue, 255

void main()
{
    const uint i = linear_thread();
    if (i >= p.pixels)
        return;
    const uint word = 3 * i / 4, shift = 8 * (3 * i % 4);
    // a pixel that begins with the third or the fourth byte of a word goes on in the next
    const uint rest = shift > 8 ? bytes[word + 1] << (32 - shift) : 0;
    texels[i] = bytes[word] >> shift & 0xffffff | rest & 0xffffff | 0xff000000;
}
