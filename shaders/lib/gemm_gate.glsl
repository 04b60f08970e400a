// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the part of the epilogue that only GEMMs have: gates of modulated tokens, one row of a table per token
layout(binding = 6) readonly buffer Gate { float gate[]; };       // [timesteps, gate_ld]
layout(binding = 7) readonly buffer GateRow { uint gate_row[]; }; // [groups * rows]
uint gate_group;                                                  // set by the variants' main()

void scale_by_gate(uint row, uint col, inout vec4 lo, inout vec4 hi)
{
    const uint g = gate_row[row] * p.gate_ld + p.gate_col + gate_group * p.gate_step + col;
    lo *= vec4(gate[g], gate[g + 1], gate[g + 2], gate[g + 3]);
    hi *= vec4(gate[g + 4], gate[g + 5], gate[g + 6], gate[g + 7]);
}

void add_shift(uint row, uint col, inout vec4 lo, inout vec4 hi) {}
