// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// mean and 1 / sqrt(var + eps) of a row of X: 16 threads a row, four rows a workgroup. The first kKept sweeps of a row
// are read once and stay in registers; the mean is taken out before squaring.
// note: kKept <= divide_up(cols, kSweep), so of the sweeps that are kept only the last one may go beyond a row
const uint kRowThreads = 16, kSweep = kRowThreads * 8, kKeptWords = kTypeX == kF16 ? 1 : 2;

uvec4 kept[kKept * kKeptWords];
shared float partial[2][64];

uint row_in_group() { return gl_LocalInvocationID.x / kRowThreads; }

// first column of this thread in a sweep
uint sweep_col(uint sweep) { return sweep * kSweep + gl_LocalInvocationID.x % kRowThreads * 8; }

bool in_row(uint sweep) { return sweep + 1 < kKept || sweep_col(sweep) < p.cols; }

void load_kept(uint sweep, out vec4 lo, out vec4 hi)
{
    LOAD8(kept, kTypeX, sweep * kKeptWords * (kTypeX == kF16 ? 8 : 4), lo, hi);
}

// every thread of a row adds the same numbers in the same order
float reduce(uint which, float v)
{
    const uint t = gl_LocalInvocationID.x, first = t - t % kRowThreads;
    partial[which][t] = v;
    barrier();
    float sum = 0.0;
    [[unroll]] for (uint i = 0; i < kRowThreads / 2; ++i)
        sum += partial[which][first + i] + partial[which][first + i + kRowThreads / 2];
    return sum;
}

float sum8(vec4 lo, vec4 hi)
{
    const vec4 v = lo + hi;
    return (v.x + v.y) + (v.z + v.w);
}

// the padding of a row
void clear_beyond(uint sweep, inout vec4 lo, inout vec4 hi)
{
    if (sweep + 1 >= kKept && sweep_col(sweep) + 8 > p.cols)
        clear_padding(sweep_col(sweep), p.cols, lo, hi);
}

float squares(uint sweep, vec4 lo, vec4 hi, float mean)
{
    lo -= mean;
    hi -= mean;
    clear_beyond(sweep, lo, hi);
    return sum8(lo * lo, hi * hi);
}

// first: element of X with which the row starts. All threads of the workgroup must come here.
void row_statistics(uint first, out float mean, out float inverse)
{
    vec4 lo, hi;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        const uint at = (first + sweep_col(i)) / (kTypeX == kF16 ? 8 : 4);
        [[unroll]] for (uint w = 0; w < kKeptWords; ++w) {
            kept[i * kKeptWords + w] = uvec4(0);
            if (in_row(i))
                kept[i * kKeptWords + w] = x[at + w];
        }
    }
    float sum = 0.0; // padding is zero
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        sum += sum8(lo, hi);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, first + sweep_col(i), lo, hi);
        sum += sum8(lo, hi);
    }
    mean = reduce(0, sum) / float(p.cols);
    sum = 0.0;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        sum += squares(i, lo, hi, mean);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, first + sweep_col(i), lo, hi);
        sum += squares(i, lo, hi, mean);
    }
    inverse = inversesqrt(reduce(1, sum) / float(p.cols) + p.eps);
}
