#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v over the frames of one video, per pixel and head. A thread has one frame of a pixel and
// head, and the scores of all frames in registers; threads side by side share keys and values, which are few enough to
// stay in the cache.
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeQkv = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kFrames = 1;
layout(push_constant) uniform FrameAttentionPush {
    uint image_rows; // from one frame to the next
    uint heads;
    uint chunks; // head_dim / 8
    uint qkv_ld; // elements
    uint y_ld;
    float scale; // log2(e) times that of the scores: the exponential is one of base 2
} p;
layout(binding = 0) readonly buffer Qkv { uvec4 qkv[]; }; // [frames * image_rows, 3 * heads * head_dim]
layout(binding = 1) writeonly buffer Y { uvec4 y[]; };    // [frames * image_rows, heads * head_dim]

void main()
{
    const uint frame = linear_thread() % kFrames, column = linear_thread() / kFrames;
    const uint pixel = column / p.heads, head = column % p.heads * p.chunks * 8;
    if (pixel >= p.image_rows)
        return;
    const uint row = frame * p.image_rows + pixel, width = p.heads * p.chunks * 8;
    const uint q_at = row * p.qkv_ld + head, step = p.image_rows * p.qkv_ld;
    const uint k_at = pixel * p.qkv_ld + width + head, v_at = k_at + width;
    float s[kFrames];
    for (uint j = 0; j < kFrames; ++j)
        s[j] = 0.0;
    for (uint c = 0; c < p.chunks; ++c) {
        vec4 q_lo, q_hi, k_lo, k_hi;
        LOAD8(qkv, kTypeQkv, q_at + c * 8, q_lo, q_hi);
        for (uint j = 0; j < kFrames; ++j) {
            LOAD8(qkv, kTypeQkv, k_at + j * step + c * 8, k_lo, k_hi);
            s[j] += dot(q_lo, k_lo) + dot(q_hi, k_hi);
        }
    }
    float largest = s[0], total = 0.0;
    for (uint j = 1; j < kFrames; ++j)
        largest = max(largest, s[j]);
    for (uint j = 0; j < kFrames; ++j) {
        s[j] = exp2((s[j] - largest) * p.scale);
        total += s[j];
    }
    const float inverse = 1.0 / total;
    for (uint c = 0; c < p.chunks; ++c) {
        vec4 lo = vec4(0.0), hi = vec4(0.0), v_lo, v_hi;
        for (uint j = 0; j < kFrames; ++j) {
            LOAD8(qkv, kTypeQkv, v_at + j * step + c * 8, v_lo, v_hi);
            lo += s[j] * v_lo;
            hi += s[j] * v_hi;
        }
        STORE8(y, kTypeY, row * p.y_ld + head + c * 8, (lo * inverse), (hi * inverse));
    }
}
