#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// index of the first element that is NaN or infinite; an element a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform FirstNonFinitePush {
    uint elements; // of the pixels that count
    uint cols;
    uint width;   // pixels of a line that count
    uint x_width; // pixels from one line to the next
    uint x_ld;
} p;
layout(binding = 0) readonly buffer X { uint x[]; }; // [rows, cols] the bits of floats
layout(binding = 1) buffer First { uint first[]; };  // [1] 2^32 - 1 before

void main()
{
    const uint i = linear_thread();
    if (i >= p.elements)
        return;
    const uint pixel = i / p.cols, row = pixel / p.width * p.x_width + pixel % p.width;
    const uint bits = x[row * p.x_ld + i % p.cols];
    if ((bits & 0x7f800000u) == 0x7f800000u) // by its bits: comparisons may be optimised away
        atomicMin(first[0], i);
}
