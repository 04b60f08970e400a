// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// mean and m2 = sum of (v - mean)^2 of 16 rows of eight columns. Sums are taken from the first value on, so that a
// large mean costs no digits; merged as in Chan, Golub and LeVeque 1979.
const uint kMomentRows = 16;

struct ColumnMoments {
    uint count;
    vec4 first[2], sum[2], squares[2];
};

ColumnMoments no_moments() { return ColumnMoments(0, vec4[2](vec4(0), vec4(0)), vec4[2](vec4(0), vec4(0)), vec4[2](vec4(0), vec4(0))); }

void add_moments(inout ColumnMoments m, vec4 lo, vec4 hi)
{
    if (m.count == 0) {
        m.first[0] = lo;
        m.first[1] = hi;
    }
    const vec4 d_lo = lo - m.first[0], d_hi = hi - m.first[1];
    m.sum[0] += d_lo;
    m.sum[1] += d_hi;
    m.squares[0] += d_lo * d_lo;
    m.squares[1] += d_hi * d_hi;
    ++m.count;
}

void column_moments(ColumnMoments m, out vec4 mean[2], out vec4 m2[2])
{
    const float n = max(float(m.count), 1.0);
    [[unroll]] for (uint i = 0; i < 2; ++i) {
        mean[i] = m.first[i] + m.sum[i] / n;
        m2[i] = max(m.squares[i] - m.sum[i] * m.sum[i] / n, 0.0);
    }
}
