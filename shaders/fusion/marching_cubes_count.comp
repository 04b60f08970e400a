#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a workgroup a block: edges[i] = which of the three edges above voxel i carry a vertex (3 bits), vertices of the block
// before it << 3; vertices and faces of every block. An edge carries one where a cell around it says that its ends
// differ.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "lib/workgroup_scan.glsl"
#include "marching_cubes.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { MarchingCubesPush p; };
layout(binding = 0) readonly buffer Bitmap { uint bitmap[]; };
layout(binding = 1) readonly buffer Ranks { uint ranks[]; };
layout(binding = 2) readonly buffer Blocks { uint blocks[]; };      // [rows]
layout(binding = 3) readonly buffer Cases { uint cases[]; };        // [rows, 512]
layout(binding = 4) readonly buffer Table { uint table[]; };        // [256, 16] faces first
layout(binding = 5) writeonly buffer Edges { uint edges[]; };       // [rows, 512]
layout(binding = 6) writeonly buffer Vertices { uint vertices[]; }; // [rows]
layout(binding = 7) writeonly buffer Faces { uint faces[]; };       // [rows]

#include "lib/tsdf_block.glsl"

// axes whose edge above the voxel carries a vertex; cells[c]: of the cell c voxels (a corner's offset) below it
uint edge_mask(uint cells[8])
{
    uint mask = 0;
    for (uint a = 0; a < 3; ++a) {
        const uint b = 1u << (a + 1) % 3, c = 1u << (a + 2) % 3;
        for (uint k = 0; k < 4; ++k) {
            const uint low = (k & 1) * b + (k >> 1) * c, cell = cells[low], high = low | 1u << a;
            if ((cell & 256) != 0 && ((cell >> low ^ cell >> high) & 1) != 0)
                mask |= 1u << a;
        }
    }
    return mask;
}

void main()
{
    const uint block = linear_group();
    if (block >= p.rows)
        return;
    const uvec3 box = uvec3(p.blocks_x, p.blocks_y, p.blocks_z);
    const ivec3 origin = 8 * ivec3(block_at(blocks[block], box));
    uint masks = 0, own = 0, own_faces = 0; // of eight voxels in x
    for (uint x = 0; x < 8; ++x) {
        const uint i = gl_LocalInvocationID.x * 8 + x;
        uint cells[8];
        for (uint c = 0; c < 8; ++c) {
            const ivec3 local = local_at(i) - corner_at(c);
            const bool inside = all(greaterThanEqual(local, ivec3(0)));
            const uint at = inside ? block * 512 + uint((local.z * 8 + local.y) * 8 + local.x)
                                   : voxel_index(origin + local, box);
            cells[c] = at == kNoVoxel ? 0 : cases[at];
        }
        const uint mask = edge_mask(cells);
        masks |= mask << (3 * x);
        own += bitCount(mask);
        own_faces += (cells[0] & 256) != 0 ? table[(cells[0] & 255) * 16] : 0;
    }
    uint total, total_faces;
    uint before = scan_workgroup(own, total);
    scan_workgroup(own_faces, total_faces);
    for (uint x = 0; x < 8; ++x) {
        const uint mask = masks >> (3 * x) & 7;
        edges[block * 512 + gl_LocalInvocationID.x * 8 + x] = mask | before << 3;
        before += bitCount(mask);
    }
    if (gl_LocalInvocationID.x == 0) {
        vertices[block] = total;
        faces[block] = total_faces;
    }
}
