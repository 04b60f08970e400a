#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// sorted[i] = point order[i] and its index as bits, so that the search reads neighbours side by side
#extension GL_GOOGLE_include_directive : require
#include "knn.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kLabels = false;
layout(push_constant) uniform Push { KnnPush p; };
layout(binding = 0) readonly buffer Points { float points[]; };               // [rows, points_ld]
layout(binding = 1) readonly buffer Labels { uint labels[]; };                // [rows]
layout(binding = 2) readonly buffer Order { uint order[]; };                  // [rows]
layout(binding = 3) writeonly buffer Sorted { vec4 sorted_points[]; };        // [rows]
layout(binding = 4) writeonly buffer SortedLabels { uint sorted_labels[]; }; // [rows]

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const uint from = order[i], at = from * p.points_ld;
    sorted_points[i] = vec4(points[at], points[at + 1], points[at + 2], uintBitsToFloat(from));
    sorted_labels[i] = kLabels ? labels[from] : 0;
}
