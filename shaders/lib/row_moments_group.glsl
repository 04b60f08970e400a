// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// mean and deviation of a row, by a workgroup of 64 threads that owns it; the mean is taken out before squaring.
// Wants x (uvec4 words), kHalfX and p with x_ld, cols and eps in front.
#include "lib/pack.glsl"

shared float partial[64];

float reduce(float v) // fixed tree: the same sum whatever the subgroup size
{
    const uint t = gl_LocalInvocationID.x;
    partial[t] = v;
    barrier();
    for (uint half_size = 32; half_size > 0; half_size /= 2) {
        if (t < half_size)
            partial[t] += partial[t + half_size];
        barrier();
    }
    const float sum = partial[0];
    barrier();
    return sum;
}

float sum4(vec4 v) { return (v.x + v.y) + (v.z + v.w); }

struct RowMoments {
    float mean, inverse; // inverse = 1 / sqrt(variance + eps)
};
const uint kRowStride = 64 * 8; // columns that the workgroup takes at once, eight a thread

RowMoments row_moments(uint row)
{
    RowMoments m;
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = gl_LocalInvocationID.x * 8; c < p.cols; c += kRowStride) { // padding is zero
        LOAD8(x, kHalfX, row * p.x_ld + c, lo, hi);
        sum += sum4(lo) + sum4(hi);
    }
    m.mean = reduce(sum) / float(p.cols);
    sum = 0.0;
    for (uint c = gl_LocalInvocationID.x * 8; c < p.cols; c += kRowStride) {
        LOAD8(x, kHalfX, row * p.x_ld + c, lo, hi);
        lo -= m.mean;
        hi -= m.mean;
        clear_padding(c, p.cols, lo, hi);
        sum += sum4(lo * lo) + sum4(hi * hi);
    }
    m.inverse = inversesqrt(reduce(sum) / float(p.cols) + p.eps);
    return m;
}
