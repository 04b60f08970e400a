#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// tiles[i] = how many tiles the i-th nearest record touches
#extension GL_GOOGLE_include_directive : require
#include "splat.h"
#include "lib/splat_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTexels = kRecord; // of a record; more than kRecord: of cameras with lenses
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Records { uvec4 records[]; };  // [max_visible, kTexels]
layout(binding = 1) readonly buffer Order { uint order[]; };       // [max_visible] records, nearest first
layout(binding = 2) readonly buffer Count { uint count[]; };       // [1] visible splats
layout(binding = 3) writeonly buffer Tiles { uint tiles[]; };      // [max_visible]

void main()
{
    const uint i = linear_thread();
    if (i >= min(count[0], p.max_visible))
        return;
    if (kTexels != kRecord) {
        const uvec4 span = tile_span(records[order[i] * kTexels].zw, p.tile, p.tiles_x);
        tiles[i] = span.y * span.w;
        return;
    }
    const uvec4 range = tile_range(records[order[i] * kTexels].zw, p.tile);
    tiles[i] = (range.y - range.x + 1) * (range.w - range.z + 1);
}
