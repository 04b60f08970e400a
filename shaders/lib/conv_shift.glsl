// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the part of the epilogue that only convolutions have: a row of a table per image, added to every pixel
layout(binding = 6) readonly buffer Shift { vec4 shift[]; };        // [timesteps, shift_ld]
layout(binding = 7) readonly buffer ShiftRow { uint shift_row[]; }; // [images]

void add_shift(uint row, uint col, inout vec4 lo, inout vec4 hi)
{
    const uint at = shift_row[(row + p.first_row) / p.image_rows] * p.shift_ld + p.shift_col + col;
    lo += shift[at / 4];
    hi += shift[at / 4 + 1];
}

void scale_by_gate(uint row, uint col, inout vec4 lo, inout vec4 hi) {}
