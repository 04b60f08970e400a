#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels of cameras with lenses, front to back, for devices that are CPUs: as splat_blend.cpu.comp
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "splat.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTileM = 8; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 8; // and columns
layout(binding = 0) uniform usamplerBuffer Records; // [max_visible, kRayRecord]
#include "lib/splat_ray.glsl"

const uint kRows = 8;

Pixel pixels[kRows];

bool overlaps(uvec2 bounds, uvec2 corner)
{
    const uint first = bounds.x & 0xffff, last = bounds.x >> 16;
    const bool from = first < corner.x + 8, to = last >= corner.x, across = first <= last ? from && to : from || to;
    return across && (bounds.y & 0xffff) < corner.y + 8 && bounds.y >> 16 >= corner.y;
}

void main()
{
    const uint camera = gl_WorkGroupID.z, lane = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 8, tile_at = corner / p.tile;
    const uint tile = (camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x, end = starts[tile + 1];
    vec4 ray[kRows];
    bool going = false;
    [[unroll]] for (uint y = 0; y < kRows; ++y) {
        ray[y] = pixel_ray(corner + uvec2(lane, y), camera);
        pixels[y] = pixel_of_ray(ray[y]);
        going = going || ray[y].w != 0.0;
    }
    uint i = starts[tile];
    while (going) {
        uint record = kNone;
        vec4 t0;
        while (i < end && record == kNone) {
            const uint next = pairs[i++];
            const uvec4 texel = texelFetch(Records, int(next * kRayRecord));
            t0 = uintBitsToFloat(texel);
            record = overlaps(texel.zw, corner) ? next : kNone;
        }
        if (record == kNone)
            break;
        const int at = int(record * kRayRecord);
        const RaySplat s = read_splat(t0, uintBitsToFloat(texelFetch(Records, at + 1)), uintBitsToFloat(texelFetch(Records, at + 2)),
                                      uintBitsToFloat(texelFetch(Records, at + 3)), uintBitsToFloat(texelFetch(Records, at + 4)));
        going = false;
        [[unroll]] for (uint y = 0; y < kRows; ++y) {
            blend(pixels[y], s, ray[y], vec2(corner + uvec2(lane, y)) + 0.5, record);
            going = going || pixels[y].transmittance > 0.0;
        }
    }
    [[unroll]] for (uint y = 0; y < kRows; ++y)
        store(pixels[y], corner + uvec2(lane, y), camera);
}
