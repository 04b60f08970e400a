// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the outputs of a lane, their products over eight columns of K, and what becomes of them
layout(constant_id = 34) const uint kLaneCols = 16; // 8 or 16; 16 for GEGLU
const uint kRows = 16;
const uint kCols = kLaneCols;

float acc[kRows][kCols];

void clear_tile()
{
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        [[unroll]] for (uint j = 0; j < kCols; ++j)
            acc[i][j] = 0.0;
}

// eight columns of 16 rows of x, and of the rows of w that begin at these texels, from k on
void multiply(vec4 a_lo[kRows], vec4 a_hi[kRows], uint w_at[kCols], uint k)
{
    [[unroll]] for (uint j = 0; j < kCols; ++j) {
        vec4 lo, hi;
        load_weight8(w_at[j], k, lo, hi);
        [[unroll]] for (uint i = 0; i < kRows; ++i) {
            float s = acc[i][j];
            s += a_lo[i].x * lo.x;
            s += a_lo[i].y * lo.y;
            s += a_lo[i].z * lo.z;
            s += a_lo[i].w * lo.w;
            s += a_hi[i].x * hi.x;
            s += a_hi[i].y * hi.y;
            s += a_hi[i].z * hi.z;
            s += a_hi[i].w * hi.w;
            acc[i][j] = s;
        }
    }
}

// through memory, so that the epilogue is compiled once and not once per eight outputs: a third of the compile time
float tile[kRows * kCols];

void load_tile(uint at, out vec4 lo, out vec4 hi)
{
    lo = vec4(tile[at], tile[at + 1], tile[at + 2], tile[at + 3]);
    hi = vec4(tile[at + 4], tile[at + 5], tile[at + 6], tile[at + 7]);
}

void store_tile(uint row, uint col)
{
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        [[unroll]] for (uint j = 0; j < kCols; ++j)
            tile[i * kCols + j] = acc[i][j];
    [[dont_unroll]] for (uint c = 0; c < kCols; c += kGeglu ? 16 : 8) {
        if (col + c >= p.cols)
            break;
        ColumnMoments m = no_moments();
        [[dont_unroll]] for (uint i = 0; i < kRows; ++i) {
            if (row + i >= p.rows)
                break;
            vec4 lo, hi;
            load_tile(i * kCols + c, lo, hi);
            activate8(row + i, col + c, lo, hi);
            if (kGeglu) {
                vec4 gate_lo, gate_hi;
                load_tile(i * kCols + c + 8, gate_lo, gate_hi);
                activate8(row + i, col + c + 8, gate_lo, gate_hi);
                lo *= gelu_erf(gate_lo);
                hi *= gelu_erf(gate_hi);
            }
            finish8(row + i, kGeglu ? (col + c) / 2 : col + c, kGeglu ? p.cols / 2 : p.cols, lo, hi);
            if (kMoments && counts_in_moments(row + i))
                add_moments(m, lo, hi);
        }
        if (kMoments && row < p.rows)
            store_moments(row, col + c, m);
    }
}
