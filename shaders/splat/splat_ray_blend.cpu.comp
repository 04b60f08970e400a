#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels of cameras with lenses, front to back, for devices that are CPUs: as splat_blend.cpu.comp
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#include "splat.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTileM = 8; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 8; // and columns
layout(binding = 0) uniform usamplerBuffer Records; // [max_visible, kTexels]
#include "lib/splat_ray.glsl"

const uint kRows = 8;

Pixel pixels[kRows];

bool overlaps(uvec2 bounds, uvec2 corner)
{
    const uint first = bounds.x & 0xffff, last = bounds.x >> 16;
    const bool from = first < corner.x + 8, to = last >= corner.x, across = first <= last ? from && to : from || to;
    return across && (bounds.y & 0xffff) < corner.y + 8 && bounds.y >> 16 >= corner.y;
}

#include "lib/splat_walk.cpu.glsl"

void main()
{
    const uint camera = gl_WorkGroupID.z, column = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 8, tile_at = corner / p.tile;
    Ray ray[kRows];
    [[unroll]] for (uint y = 0; y < kRows; ++y) {
        ray[y] = pixel_ray(corner + uvec2(column, y), camera);
        pixels[y] = pixel_of_ray(ray[y]);
    }
    Walk walk = walk_of((camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x);
    while (any_left() && find_hits(walk, corner)) {
        do {
            const uint record = take_hit(walk);
            vec4 drift = vec4(0.0);
            if (kMoving)
                drift = texel_of(record, 5);
            const RaySplat s = read_splat(texel_of(record, 0), texel_of(record, 1), texel_of(record, 2), texel_of(record, 3),
                                          texel_of(record, 4), drift);
            [[unroll]] for (uint y = 0; y < kRows; ++y)
                blend(pixels[y], s, ray[y], vec2(corner + uvec2(column, y)) + 0.5, record);
        } while (walk.hits != 0);
    }
    [[unroll]] for (uint y = 0; y < kRows; ++y)
        store_ray(pixels[y], corner + uvec2(column, y), camera);
}
