#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(scale x) over the columns of every row, a workgroup a row
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 1;
layout(push_constant) uniform SoftmaxPush {
    uint rows;
    uint cols;  // that count
    uint width; // columns of y that are written, a multiple of 8: zeros from `cols` on
    uint x_ld;  // elements
    uint y_ld;
    float scale; // of x, times log2(e)
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };  // [rows, cols]
layout(binding = 1) writeonly buffer Y { uvec4 y[]; }; // [rows, width]

shared float partial[128];

// fixed trees: the same bits whatever the subgroup size
float largest_of_all(float v)
{
    const uint t = gl_LocalInvocationID.x;
    partial[t] = v;
    for (uint step = 64; step > 0; step /= 2) {
        barrier();
        if (t < step)
            partial[t] = max(partial[t], partial[t + step]);
    }
    barrier();
    return partial[0];
}

float sum_of_all(float v)
{
    const uint t = gl_LocalInvocationID.x;
    barrier(); // the largest is read
    partial[t] = v;
    for (uint step = 64; step > 0; step /= 2) {
        barrier();
        if (t < step)
            partial[t] += partial[t + step];
    }
    barrier();
    return partial[0];
}

// eight logits times log2(e); what does not count is as small as can be
void load(uint row, uint col, out vec4 lo, out vec4 hi)
{
    LOAD8(x, kTypeX, row * p.x_ld + col, lo, hi);
    const uvec4 i = uvec4(0, 1, 2, 3) + col;
    lo = mix(vec4(-1e30), lo * p.scale, lessThan(i, uvec4(p.cols)));
    hi = mix(vec4(-1e30), hi * p.scale, lessThan(i + 4, uvec4(p.cols)));
}

void main()
{
    const uint row = linear_group();
    if (row >= p.rows)
        return;
    const uint first = gl_LocalInvocationID.x * 8, stride = 128 * 8;
    vec4 lo, hi, most = vec4(-1e30), sum = vec4(0.0);
    for (uint c = first; c < p.cols; c += stride) {
        load(row, c, lo, hi);
        most = max(most, max(lo, hi));
    }
    const float largest = largest_of_all(max(max(most.x, most.y), max(most.z, most.w)));
    for (uint c = first; c < p.cols; c += stride) {
        load(row, c, lo, hi);
        sum += exp2(lo - largest) + exp2(hi - largest);
    }
    const float inverse = 1.0 / sum_of_all((sum.x + sum.y) + (sum.z + sum.w));
    for (uint c = first; c < p.width; c += stride) {
        lo = hi = vec4(0.0);
        if (c < p.cols) {
            load(row, c, lo, hi);
            lo = exp2(lo - largest) * inverse;
            hi = exp2(hi - largest) * inverse;
        }
        STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
    }
}
