#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a pair (tile, record) for every tile that a record touches, nearest record first; tiles are numbered by camera, row
// and column. The bounds are those that were counted, so that no pair is left unwritten.
#extension GL_GOOGLE_include_directive : require
#include "splat.h"
#include "lib/splat_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTexels = kRecord; // of a record; more than kRecord: of cameras with lenses
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Records { uvec4 records[]; };      // [max_visible, kTexels]
layout(binding = 1) readonly buffer Sources { uint sources[]; };       // [max_visible]
layout(binding = 2) readonly buffer Order { uint order[]; };           // [max_visible] records, nearest first
layout(binding = 3) readonly buffer Count { uint count[]; };           // [1] visible splats
layout(binding = 4) readonly buffer First { uint first[]; };           // [max_visible] pairs before those of record i
layout(binding = 5) writeonly buffer PairTiles { uint pair_tiles[]; }; // [max_pairs]
layout(binding = 6) writeonly buffer PairRecords { uint pair_records[]; };

void put(uint to, uint tile, uint slot)
{
    if (to < p.max_pairs) {
        pair_tiles[to] = tile;
        pair_records[to] = slot;
    }
}

void main()
{
    const uint i = linear_thread();
    if (i >= min(count[0], p.max_visible))
        return;
    const uint slot = order[i];
    const uint camera = sources[slot] / p.splats;
    uint to = first[i];
    if (kTexels != kRecord) {
        const uvec4 span = tile_span(records[slot * kTexels].zw, p.tile, p.tiles_x);
        for (uint y = 0; y < span.w; ++y)
            for (uint x = 0; x < span.y; ++x, ++to)
                put(to, (camera * p.tiles_y + span.z + y) * p.tiles_x + (span.x + x) % p.tiles_x, slot);
        return;
    }
    const uvec4 range = tile_range(records[slot * kTexels].zw, p.tile);
    for (uint y = range.z; y <= range.w; ++y)
        for (uint x = range.x; x <= range.y; ++x, ++to)
            put(to, (camera * p.tiles_y + y) * p.tiles_x + x, slot);
}
