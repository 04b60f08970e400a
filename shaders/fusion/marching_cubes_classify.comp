#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// cases[i] = signs of the eight corners of the cell above voxel i (bit: inside), bit 8 where the cell makes surface:
// all corners observed, signs mixed, one corner seen by enough frames, distances no further apart than a surface that
// was seen can make them
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "marching_cubes.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { MarchingCubesPush p; };
layout(binding = 0) readonly buffer Bitmap { uint bitmap[]; };
layout(binding = 1) readonly buffer Ranks { uint ranks[]; };
layout(binding = 2) readonly buffer Blocks { uint blocks[]; };          // [rows / 512]
layout(binding = 3) readonly buffer Distances { float distances[]; };   // [rows], 2: unobserved
layout(binding = 4) readonly buffer Attributes { uint attributes[]; }; // [rows]
layout(binding = 5) writeonly buffer Cases { uint cases[]; };           // [rows]

#include "lib/tsdf_block.glsl"

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const uvec3 box = uvec3(p.blocks_x, p.blocks_y, p.blocks_z);
    const ivec3 voxel = 8 * ivec3(block_at(blocks[i / 512], box)) + local_at(i % 512);
    float least = 2.0, most = -2.0;
    uint signs = 0, views = 0;
    bool observed = true;
    for (uint c = 0; c < 8 && observed; ++c) {
        const uint at = voxel_index(voxel + corner_at(c), box);
        const float d = at == kNoVoxel ? 2.0 : distances[at];
        observed = d <= 1.5;
        if (observed)
            views = max(views, attributes[at] >> 29);
        least = min(least, d);
        most = max(most, d);
        signs |= uint(d < 0.0) << c;
    }
    const bool surface = observed && signs != 0 && signs != 255 && views >= p.min_views && most - least <= p.max_jump;
    cases[i] = surface ? signs | 256 : 0;
}
