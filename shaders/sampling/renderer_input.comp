#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = [in_scale x, previous, buffer, visible], once per guidance half: in rows beyond those of x, the unconditional
// half, previous and visible are zeros; eight elements a thread. Of two latents previous is left out.
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeY = kF16;
layout(push_constant) uniform RendererInputPush {
    uint rows; // of y
    uint x_rows;
    uint channels;  // of a latent
    uint latents;   // in a row: 3, or 2 without the previous one
    uint latent_ld; // elements, of x, previous and buffer
    uint visible_ld;
    uint y_ld;
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) readonly buffer X { float x[]; };               // [x_rows, channels]
layout(binding = 3) readonly buffer Previous { float previous[]; }; // [x_rows, channels]
layout(binding = 4) readonly buffer Latent { float latent[]; };     // [x_rows, channels] the buffer's
layout(binding = 5) readonly buffer Visible { float visible[]; };   // [x_rows, 1]
layout(binding = 6) writeonly buffer Y { uvec4 y[]; };              // [rows, 3 channels + 1]

float value(uint row, uint col, bool conditional, float scale)
{
    const uint part = col / p.channels, at = row * p.latent_ld + col % p.channels;
    if (part == 0)
        return scale * x[at];
    if (part + 1 == p.latents)
        return latent[at];
    if (part == 1)
        return conditional ? previous[at] : 0.0;
    return conditional && col == p.latents * p.channels ? visible[row * p.visible_ld] : 0.0;
}

void main()
{
    const uint per_row = (p.latents * p.channels + 8) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    const uint from = row % p.x_rows;
    const bool conditional = row < p.x_rows;
    const float scale = steps[clock.row].in_scale;
    vec4 lo, hi;
    for (uint i = 0; i < 4; ++i) {
        lo[i] = value(from, col + i, conditional, scale);
        hi[i] = value(from, col + 4 + i, conditional, scale);
    }
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
