#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = sum over channels of w (a / (|a| + eps) - b / (|b| + eps))^2, a pixel a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeA = kF16;
layout(constant_id = 1) const uint kTypeB = kF16;
layout(push_constant) uniform UnitDistancePush {
    uint rows;
    uint a_ld;
    uint b_ld;
    uint y_ld;
    uint width; // columns worked on, a multiple of 8
    float eps;
} p;
layout(binding = 0) readonly buffer A { uvec4 a[]; };  // [rows, a_ld]
layout(binding = 1) readonly buffer B { uvec4 b[]; };  // [rows, b_ld]
layout(binding = 2) readonly buffer W { vec4 w[]; };   // [1, width] fp32
layout(binding = 3) writeonly buffer Y { vec4 y[]; };  // [rows, y_ld] fp32

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    vec4 a_lo, a_hi, b_lo, b_hi;
    float aa = 0.0, bb = 0.0;
    for (uint c = 0; c < p.width; c += 8) {
        LOAD8(a, kTypeA, row * p.a_ld + c, a_lo, a_hi);
        LOAD8(b, kTypeB, row * p.b_ld + c, b_lo, b_hi);
        aa += dot(a_lo, a_lo) + dot(a_hi, a_hi);
        bb += dot(b_lo, b_lo) + dot(b_hi, b_hi);
    }
    const float of_a = 1.0 / (sqrt(aa) + p.eps), of_b = 1.0 / (sqrt(bb) + p.eps);
    float sum = 0.0;
    for (uint c = 0; c < p.width; c += 8) {
        LOAD8(a, kTypeA, row * p.a_ld + c, a_lo, a_hi);
        LOAD8(b, kTypeB, row * p.b_ld + c, b_lo, b_hi);
        // note: not one product fused with the difference, which would not be 0 where a is b
        precise const vec4 lo = a_lo * of_a - b_lo * of_b, hi = a_hi * of_a - b_hi * of_b;
        sum += dot(w[c / 4] * lo, lo) + dot(w[c / 4 + 1] * hi, hi);
    }
    y[row * p.y_ld / 4] = vec4(sum, 0.0, 0.0, 0.0);
    y[row * p.y_ld / 4 + 1] = vec4(0.0);
}
