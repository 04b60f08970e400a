#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// per head of q and k: y = x / sqrt(mean(x^2) + eps) * weight; v is copied. One head of one row a thread.
// weight rows: 2 * group for q, 2 * group + 1 for k
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(push_constant) uniform HeadRmsNormPush {
    uint rows; // of one group
    uint groups;
    uint heads;
    uint head_dim; // a multiple of 8
    uint x_ld;     // elements
    uint y_ld;
    uint weight_ld;
    float eps;
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };          // [groups * rows, 3 * heads * head_dim]
layout(binding = 1) readonly buffer Weight { float weight[]; }; // [2 * groups, head_dim]
layout(binding = 2) writeonly buffer Y { uvec4 y[]; };         // as x

void main()
{
    const uint slots = 3 * p.heads;
    const uint row = linear_thread() / slots, slot = linear_thread() % slots, part = slot / p.heads;
    if (row >= p.rows * p.groups)
        return;
    const uint from = row * p.x_ld + slot * p.head_dim, to = row * p.y_ld + slot * p.head_dim;
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = 0; c < p.head_dim; c += 8) {
        LOAD8(x, kTypeX, from + c, lo, hi);
        sum += dot(lo, lo) + dot(hi, hi);
    }
    const float inverse = inversesqrt(sum / float(p.head_dim) + p.eps);
    const uint w = (row / p.rows * 2 + min(part, 1u)) * p.weight_ld;
    for (uint c = 0; c < p.head_dim; c += 8) {
        LOAD8(x, kTypeX, from + c, lo, hi);
        if (part < 2) {
            lo *= inverse * vec4(weight[w + c], weight[w + c + 1], weight[w + c + 2], weight[w + c + 3]);
            hi *= inverse * vec4(weight[w + c + 4], weight[w + c + 5], weight[w + c + 6], weight[w + c + 7]);
        }
        STORE8(y, kTypeY, to + c, lo, hi);
    }
}
