// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Rows of a weight, whose type is its own. To be included after kTypeW and
//   WEIGHT(i)  texel i of W

// texel that a row begins with, of rows of `ld` elements
uint weight_row(uint row, uint ld) { return row * (ld / (kTypeW == kF16 ? 8 : 4)); }

// eight elements of a row from k on, a multiple of 8
void load_weight8(uint row_at, uint k, out vec4 lo, out vec4 hi)
{
    UNPACK8(kTypeW, WEIGHT(row_at + k / 8), WEIGHT(row_at + k / 4), WEIGHT(row_at + k / 4 + 1), lo, hi)
}
