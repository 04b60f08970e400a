#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a workgroup a block: its triangles, corners as indices of vertices, counter-clockwise seen from outside
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "lib/workgroup_scan.glsl"
#include "marching_cubes.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { MarchingCubesPush p; };
layout(binding = 0) readonly buffer Bitmap { uint bitmap[]; };
layout(binding = 1) readonly buffer Ranks { uint ranks[]; };
layout(binding = 2) readonly buffer Blocks { uint blocks[]; };            // [blocks]
layout(binding = 3) readonly buffer Cases { uint cases[]; };              // [blocks, 512]
layout(binding = 4) readonly buffer Edges { uint edges[]; };              // [blocks, 512]
layout(binding = 5) readonly buffer Table { uint table[]; };              // [256, 16] faces, then three edges a face
layout(binding = 6) readonly buffer FirstVertex { uint first_vertex[]; }; // [blocks]
layout(binding = 7) readonly buffer FirstFace { uint first_face[]; };     // [blocks]
layout(binding = 8) writeonly buffer Faces { uint faces[]; };             // [.., 3]

#include "lib/tsdf_block.glsl"

// index of the vertex on edge e of a cell: axis e / 4, offsets along the next two axes in the low bits
uint vertex_of(ivec3 cell, uint e, uvec3 box)
{
    const uint a = e / 4;
    ivec3 owner = cell;
    owner[(a + 1) % 3] += int(e & 1);
    owner[(a + 2) % 3] += int(e >> 1 & 1);
    const uint at = voxel_index(owner, box), edge = edges[at];
    return first_vertex[at / 512] + (edge >> 3) + bitCount(edge & ((1u << a) - 1));
}

void main()
{
    if (linear_group() >= p.rows)
        return;
    const uint block = p.first_row + linear_group(), t = gl_LocalInvocationID.x;
    const uvec3 box = uvec3(p.blocks_x, p.blocks_y, p.blocks_z);
    const ivec3 origin = 8 * ivec3(block_at(blocks[block], box));
    uint own = 0, total;
    for (uint x = 0; x < 8; ++x) {
        const uint cell = cases[block * 512 + t * 8 + x];
        own += (cell & 256) != 0 ? table[(cell & 255) * 16] : 0;
    }
    uint to = (first_face[block] - p.first_face + scan_workgroup(own, total)) * 3;
    for (uint x = 0; x < 8; ++x) {
        const uint cell = cases[block * 512 + t * 8 + x], row = (cell & 255) * 16;
        const uint corners = (cell & 256) != 0 ? 3 * table[row] : 0;
        for (uint k = 0; k < corners; ++k)
            faces[to++] = vertex_of(origin + local_at(t * 8 + x), table[row + 1 + k], box);
    }
}
