#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// distance = D / W in truncations, 2 where nothing was observed; attributes = rgb, label << 24, views << 29. The label
// has the most votes, ties to the lower one, 31 without any; views stop at 7.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "tsdf.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TsdfPush p; };
layout(binding = 0) readonly buffer State { float state[]; };            // [blocks, kFields, 512]
layout(binding = 1) readonly buffer Votes { uint votes[]; };             // [blocks, kVoteWords, 512]
layout(binding = 2) writeonly buffer Distances { float distances[]; };   // [rows]
layout(binding = 3) writeonly buffer Attributes { uint attributes[]; }; // [rows]

const uint kFields = 7, kVoteWords = 10, kClasses = 20, kNone = 31;

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const uint at = i / 512 * kFields * 512 + i % 512, votes_at = i / 512 * kVoteWords * 512 + i % 512;
    const float weight = state[at + 512];
    distances[i] = weight > 0.0 && weight >= p.min_weight ? state[at] / weight : 2.0;
    uint best = 0, label = kNone;
    for (uint c = 0; c < kClasses; ++c) {
        const uint n = votes[votes_at + c / 2 * 512] >> (c % 2 * 16) & 0xffffu;
        if (n > best) {
            best = n;
            label = c;
        }
    }
    uint rgb = 0;
    const float color_weight = state[at + 5 * 512];
    for (uint c = 0; c < 3 && color_weight > 0.0; ++c)
        rgb |= uint(clamp(state[at + (2 + c) * 512] / color_weight + 0.5, 0.0, 255.0)) << (8 * c);
    attributes[i] = rgb | label << 24 | uint(min(state[at + 6 * 512], 7.0)) << 29;
}
