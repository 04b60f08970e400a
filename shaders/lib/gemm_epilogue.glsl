// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the epilogue of every GEMM and convolution, eight columns at a time:
//   v = sum + bias + shift;  v = gelu(v), silu(v) or relu(v);  v = h * gelu_erf(gate);  v = residual + gate * v, or residual + v;
//   moments of v
// note: the ids of the constants are in the order of application, which the fuse stage relies on
#include "lib/activation.glsl"
#include "lib/moments.glsl"
#include "lib/pack.glsl"

layout(constant_id = 10) const bool kBias = false;
layout(constant_id = 11) const bool kShift = false;
layout(constant_id = 12) const bool kGelu = false;
layout(constant_id = 13) const bool kSilu = false;
layout(constant_id = 14) const bool kRelu = false;
layout(constant_id = 15) const bool kGeglu = false;
layout(constant_id = 16) const bool kGatedAdd = false;
layout(constant_id = 17) const bool kAdd = false;
layout(constant_id = 18) const bool kMoments = false;
layout(constant_id = 20) const uint kTypeY = kF16;
layout(constant_id = 21) const uint kTypeResidual = kF16;

layout(binding = 2) readonly buffer Bias { vec4 bias[]; };          // [groups, cols]
layout(binding = 3) readonly buffer Residual { uvec4 residual[]; }; // [groups * rows, cols]
layout(binding = 4) writeonly buffer Moments { vec4 moments[]; };   // [groups * rows / 16, cols] pairs: mean, m2
layout(binding = 5) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols], or half the columns

uint epilogue_group; // set by the variants' main()

// in front of what combines columns or rows; col a multiple of 8
void activate8(uint row, uint col, inout vec4 lo, inout vec4 hi)
{
    if (kBias) {
        lo += bias[(epilogue_group * p.bias_ld + col) / 4];
        hi += bias[(epilogue_group * p.bias_ld + col) / 4 + 1];
    }
    if (kShift)
        add_shift(row, col, lo, hi);
    if (kGelu) {
        lo = gelu_tanh(lo);
        hi = gelu_tanh(hi);
    }
    if (kSilu) {
        lo = silu(lo);
        hi = silu(hi);
    }
    if (kRelu) {
        lo = max(lo, 0.0);
        hi = max(hi, 0.0);
    }
}

// row within the group and below p.rows, col < cols a multiple of 8: columns of y, of which the padding is zeroed
void finish8(uint row, uint col, uint cols, inout vec4 lo, inout vec4 hi)
{
    row += epilogue_group * p.rows;
    if (kGatedAdd || kAdd) {
        vec4 r_lo, r_hi;
        LOAD8(residual, kTypeResidual, row * p.residual_ld + col, r_lo, r_hi);
        if (kGatedAdd)
            scale_by_gate(row, col, lo, hi);
        lo += r_lo;
        hi += r_hi;
    }
    if (col + 8 > cols)
        clear_padding(col, cols, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + p.y_col + col, lo, hi);
    if (kMoments && kTypeY == kF16)
        unpack8(pack8(lo, hi), lo, hi); // statistics are of what is stored: the mean of a single pixel is that pixel
}

// is this row a pixel, and not padding of its image?
bool counts_in_moments(uint row) { return row < p.rows && (row + p.first_row) % p.moments_image_rows < p.moments_pixels; }

void write_moments(uint row, uint col, vec4 mean[2], vec4 m2[2])
{
    const uint at = ((epilogue_group * p.rows + row) / kMomentRows * p.moments_ld + 2 * col) / 4;
    [[unroll]] for (uint i = 0; i < 2; ++i) {
        moments[at + 2 * i] = vec4(mean[i].x, m2[i].x, mean[i].y, m2[i].y);
        moments[at + 2 * i + 1] = vec4(mean[i].z, m2[i].z, mean[i].w, m2[i].w);
    }
}

void store_moments(uint row, uint col, ColumnMoments m)
{
    vec4 mean[2], m2[2];
    column_moments(m, mean, m2);
    write_moments(row, col, mean, m2);
}
