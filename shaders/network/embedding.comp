#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = table[index] + x, or table[index] alone; eight elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeTable = kF16;
layout(constant_id = 1) const uint kTypeX = kF16;
layout(constant_id = 2) const uint kTypeY = kF16;
layout(constant_id = 3) const bool kAddX = false;
layout(push_constant) uniform EmbeddingPush {
    uint rows;
    uint cols;
    uint table_rows;
    uint table_ld; // elements
    uint x_ld;
    uint y_ld;
} p;
layout(binding = 0) readonly buffer Index { uint index[]; };  // [rows]
layout(binding = 1) readonly buffer Table { uvec4 table[]; }; // [table_rows, cols]
layout(binding = 2) readonly buffer X { uvec4 x[]; };         // [rows, cols]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };        // [rows, cols]

void main()
{
    const uint per_row = (p.cols + 7) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    vec4 lo, hi;
    LOAD8(table, kTypeTable, min(index[row], p.table_rows - 1) * p.table_ld + col, lo, hi);
    if (kAddX) {
        vec4 x_lo, x_hi;
        LOAD8(x, kTypeX, row * p.x_ld + col, x_lo, x_hi);
        lo += x_lo;
        hi += x_hi;
    }
    clear_padding(col, p.cols, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
