#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels, front to back, for devices that are CPUs: a workgroup of 8 threads owns 8 x 8 pixels, a column
// each, and walks the list of its tile; records come through a texel buffer, and those whose bounds miss the block are
// skipped in a loop of their own, because there a branch that nobody takes still costs. No shared memory.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "splat.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTileM = 8; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 8; // and columns
layout(binding = 0) uniform usamplerBuffer Records; // [max_visible, kRecord]
#include "lib/splat_blend.glsl"

const uint kRows = 8;

Pixel pixels[kRows];

bool overlaps(uvec2 bounds, uvec2 corner)
{
    return (bounds.x & 0xffff) < corner.x + 8 && bounds.x >> 16 >= corner.x && (bounds.y & 0xffff) < corner.y + 8 &&
           bounds.y >> 16 >= corner.y;
}

void main()
{
    const uint camera = gl_WorkGroupID.z, lane = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 8, tile_at = corner / p.tile;
    const uint tile = (camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x, end = starts[tile + 1];
    [[unroll]] for (uint y = 0; y < kRows; ++y)
        pixels[y] = empty_pixel();
    uint i = starts[tile];
    bool going = true;
    while (going) {
        uint record = kNone;
        vec4 t0;
        while (i < end && record == kNone) {
            const uint next = pairs[i++];
            const uvec4 texel = texelFetch(Records, int(next * kRecord));
            t0 = uintBitsToFloat(texel);
            record = overlaps(texel.zw, corner) ? next : kNone;
        }
        if (record == kNone)
            break;
        const Splat s = read_splat(t0, uintBitsToFloat(texelFetch(Records, int(record * kRecord + 1))),
                                   uintBitsToFloat(texelFetch(Records, int(record * kRecord + 2))),
                                   uintBitsToFloat(texelFetch(Records, int(record * kRecord + 3))));
        going = false;
        [[unroll]] for (uint y = 0; y < kRows; ++y) {
            blend(pixels[y], s, vec2(corner + uvec2(lane, y)) + 0.5, record);
            going = going || pixels[y].transmittance > 0.0;
        }
    }
    [[unroll]] for (uint y = 0; y < kRows; ++y)
        store(pixels[y], corner + uvec2(lane, y), camera);
}
