#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels, front to back, for devices that are CPUs: a workgroup of 8 threads owns 8 x 8 pixels, a column
// each, and walks the list of its tile; records come through a texel buffer. No shared memory. Correct at any subgroup
// size.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#include "splat.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTileM = 8; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 8; // and columns
layout(binding = 0) uniform usamplerBuffer Records; // [max_visible, kRecord]
#include "lib/splat_blend.glsl"

const uint kRows = 8, kTexels = kRecord;

Pixel pixels[kRows];

bool overlaps(uvec2 bounds, uvec2 corner)
{
    return (bounds.x & 0xffff) < corner.x + 8 && bounds.x >> 16 >= corner.x && (bounds.y & 0xffff) < corner.y + 8 &&
           bounds.y >> 16 >= corner.y;
}

#include "lib/splat_walk.cpu.glsl"

void main()
{
    const uint camera = gl_WorkGroupID.z, column = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 8, tile_at = corner / p.tile;
    float limits_of_rows[kRows];
    [[unroll]] for (uint y = 0; y < kRows; ++y) {
        pixels[y] = empty_pixel();
        limits_of_rows[y] = limit_of(corner + uvec2(column, y), camera);
    }
    Walk walk = walk_of((camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x);
    while (any_left() && find_hits(walk, corner)) {
        do {
            const uint record = take_hit(walk);
            const Splat s =
                read_splat(texel_of(record, 0), texel_of(record, 1), texel_of(record, 2), texel_of(record, 3));
            [[unroll]] for (uint y = 0; y < kRows; ++y)
                blend(pixels[y], s, vec2(corner + uvec2(column, y)) + 0.5, record, limits_of_rows[y]);
        } while (walk.hits != 0);
    }
    [[unroll]] for (uint y = 0; y < kRows; ++y)
        store(pixels[y], corner + uvec2(column, y), camera);
}
