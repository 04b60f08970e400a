// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// mean and 1 / sqrt(var + eps) of a row of X, one workgroup of 64 threads a row; the mean is taken out before squaring
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

void row_statistics(uint in_row, out float mean, out float inverse)
{
    const uint first = gl_LocalInvocationID.x * 8, stride = 64 * 8;
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = first; c < p.cols; c += stride) { // padding is zero
        LOAD8(x, kHalfX, in_row + c, lo, hi);
        sum += sum4(lo) + sum4(hi);
    }
    mean = reduce(sum) / float(p.cols);
    sum = 0.0;
    for (uint c = first; c < p.cols; c += stride) {
        LOAD8(x, kHalfX, in_row + c, lo, hi);
        lo -= mean;
        hi -= mean;
        clear_padding(c, p.cols, lo, hi);
        sum += sum4(lo * lo) + sum4(hi * hi);
    }
    inverse = inversesqrt(reduce(sum) / float(p.cols) + p.eps);
}
