// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// mean and 1 / sqrt(var + eps) of a row of X, one row a lane; the mean is taken out before squaring
void load_x(uint at, out vec4 lo, out vec4 hi) { FETCH8(X, kTypeX, at, lo, hi) }

float sum4(vec4 v) { return (v.x + v.y) + (v.z + v.w); }

void row_statistics(uint in_row, out float mean, out float inverse)
{
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = 0; c < p.cols; c += 8) { // padding is zero
        load_x(in_row + c, lo, hi);
        sum += sum4(lo) + sum4(hi);
    }
    mean = sum / float(p.cols);
    sum = 0.0;
    for (uint c = 0; c < p.cols; c += 8) {
        load_x(in_row + c, lo, hi);
        lo -= mean;
        hi -= mean;
        clear_padding(c, p.cols, lo, hi);
        sum += sum4(lo * lo) + sum4(hi * hi);
    }
    inverse = inversesqrt(sum / float(p.cols) + p.eps);
}
