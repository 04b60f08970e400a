// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// mean and deviation of a row, by the lane that owns it; the mean is taken out before squaring.
// Wants X (texels), kHalfX and p with x_ld, cols and eps in front.
#include "lib/pack.glsl"

void load_x(uint at, out vec4 lo, out vec4 hi)
{
    if (kHalfX) {
        unpack8(texelFetch(X, int(at / 8)), lo, hi);
    } else {
        lo = uintBitsToFloat(texelFetch(X, int(at / 4)));
        hi = uintBitsToFloat(texelFetch(X, int(at / 4 + 1)));
    }
}

float sum4(vec4 v) { return (v.x + v.y) + (v.z + v.w); }

struct RowMoments {
    float mean, inverse; // inverse = 1 / sqrt(variance + eps)
};

RowMoments row_moments(uint row)
{
    RowMoments m;
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = 0; c < p.cols; c += 8) { // padding is zero
        load_x(row * p.x_ld + c, lo, hi);
        sum += sum4(lo) + sum4(hi);
    }
    m.mean = sum / float(p.cols);
    sum = 0.0;
    for (uint c = 0; c < p.cols; c += 8) {
        load_x(row * p.x_ld + c, lo, hi);
        lo -= m.mean;
        hi -= m.mean;
        clear_padding(c, p.cols, lo, hi);
        sum += sum4(lo * lo) + sum4(hi * hi);
    }
    m.inverse = inversesqrt(sum / float(p.cols) + p.eps);
    return m;
}
