#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// one thread per voxel, over its pairs in their order: the area up to and with each pair (compensated, Kahan 1965), all
// of it, and the label with the largest share; ties go to the lower one, no label loses to any
#extension GL_GOOGLE_include_directive : require
#include "lib/surface_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform CellAreaPush {
    uint cells;
} p;
layout(binding = 0) readonly buffer Areas { float areas[]; };         // [pairs]
layout(binding = 1) readonly buffer Labels { uint labels[]; };        // [pairs]
layout(binding = 2) readonly buffer Starts { uint starts[]; };        // [voxels + 1]
layout(binding = 3) writeonly buffer Sums { float sums[]; };          // [pairs]
layout(binding = 4) writeonly buffer Cells { float cell_areas[]; };   // [voxels]
layout(binding = 5) writeonly buffer CellLabels { uint cell_labels[]; }; // [voxels]
layout(binding = 6) writeonly buffer Unlabelled { float unlabelled[]; }; // [voxels]

void main()
{
    const uint cell = linear_thread();
    if (cell >= p.cells)
        return;
    float by_label[kUnlabelled + 1];
    for (uint c = 0; c <= kUnlabelled; ++c)
        by_label[c] = 0.0;
    precise float sum = 0.0, lost = 0.0;
    float reached = 0.0; // the sums as they are searched: they never fall, and pairs without area add nothing
    for (uint i = starts[cell]; i < starts[cell + 1]; ++i) {
        if (areas[i] > 0.0) {
            precise float add = areas[i] - lost;
            precise float next = sum + add;
            lost = (next - sum) - add;
            sum = next;
        }
        reached = max(reached, sum);
        sums[i] = reached;
        by_label[min(labels[i], kUnlabelled)] += areas[i];
    }
    uint best = kUnlabelled;
    for (uint c = 0; c < kUnlabelled; ++c)
        if (by_label[c] > (best == kUnlabelled ? 0.0 : by_label[best]))
            best = c;
    cell_areas[cell] = reached;
    cell_labels[cell] = best;
    unlabelled[cell] = by_label[kUnlabelled];
}
