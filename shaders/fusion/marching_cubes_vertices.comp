#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the vertices of every block: where the distance between two voxels is 0, in voxels from the block's first sample,
// and attributes: colours mixed likewise, label and views of the nearer end
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "marching_cubes.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { MarchingCubesPush p; };
layout(binding = 0) readonly buffer Bitmap { uint bitmap[]; };
layout(binding = 1) readonly buffer Ranks { uint ranks[]; };
layout(binding = 2) readonly buffer Blocks { uint blocks[]; };          // [rows]
layout(binding = 3) readonly buffer Distances { float distances[]; };   // [blocks, 512]
layout(binding = 4) readonly buffer Attributes { uint attributes[]; }; // [blocks, 512]
layout(binding = 5) readonly buffer Edges { uint edges[]; };            // [blocks, 512]
layout(binding = 6) readonly buffer First { uint first[]; };            // [blocks] vertices before those of a block
layout(binding = 7) writeonly buffer Vertices { vec4 vertices[]; };     // [..] position, attributes as bits

#include "lib/tsdf_block.glsl"

uint channel(uint word, uint c) { return word >> (8 * c) & 255; }

// t: how far from a to b; an end that no frame saw near the surface has no colour
uint mixed(uint a, uint b, float t)
{
    const uint near_end = t < 0.5 ? a : b, far_end = t < 0.5 ? b : a;
    const bool has_a = a >> 29 != 0, has_b = b >> 29 != 0;
    uint rgb = has_a || has_b ? 0 : 0x808080;
    for (uint c = 0; c < 3 && (has_a || has_b); ++c) {
        const float m = mix(float(channel(a, c)), float(channel(b, c)), t);
        rgb |= (has_a && has_b ? uint(m + 0.5) : channel(has_a ? a : b, c)) << (8 * c);
    }
    const uint label = (near_end >> 24 & 31) < 31 ? near_end >> 24 & 31 : far_end >> 24 & 31;
    return rgb | label << 24 | max(a >> 29, b >> 29) << 29;
}

void main()
{
    const uint i = p.first_row * 512 + linear_thread(), block = i / 512;
    if (linear_thread() >= p.rows * 512)
        return;
    const uint edge = edges[i];
    if ((edge & 7) == 0)
        return;
    const uvec3 box = uvec3(p.blocks_x, p.blocks_y, p.blocks_z);
    const ivec3 local = local_at(i % 512), origin = 8 * ivec3(block_at(blocks[block], box));
    uint to = first[block] - p.first_vertex + (edge >> 3);
    for (uint a = 0; a < 3; ++a) {
        if ((edge & 1u << a) == 0)
            continue;
        ivec3 up = ivec3(0);
        up[a] = 1;
        const uint other = voxel_index(origin + local + up, box);
        const float d = distances[i], e = distances[other], t = clamp(d / (d - e), 0.0, 1.0);
        const uint packed = mixed(attributes[i], attributes[other], t);
        vertices[to++] = vec4(vec3(local) + t * vec3(up), uintBitsToFloat(packed));
    }
}
