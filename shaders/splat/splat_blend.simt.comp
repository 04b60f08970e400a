#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels, front to back, for GPUs: a workgroup of 64 threads owns 8 x 8 pixels, one a thread, and walks the
// list of its tile through 64 records in shared memory, until the list or its last pixel is done. Each half of the
// workgroup, 8 x 4 pixels, looks only at the records whose bounds touch it. The longest lists decide how long a frame
// takes, so the next records are on their way meanwhile, and two splats are looked at side by side. 4.1 KiB; needs no
// subgroup operation.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "splat.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 8; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 8; // and columns
layout(binding = 0) readonly buffer Records { uvec4 records[]; }; // [max_visible, kRecord]
#include "lib/splat_blend.glsl"

const uint kBatch = 64;              // records in shared memory
shared vec4 batch[kBatch * kRecord]; // the normal unpacked: x and y in place of the bounds, z in place of its bits
shared uint touching[2][2 * 2];      // of this batch and of the next, by turns: a bit a record, two words a half
shared uint living[2];               // is a pixel not done? Likewise

vec4 ahead[kRecord]; // the thread's record of the next batch

uint pair_at(uint i, uint end) { return i < end ? pairs[i] : kNone; }

void fetch(uint record)
{
    if (record != kNone)
        [[unroll]] for (uint j = 0; j < kRecord; ++j)
            ahead[j] = uintBitsToFloat(records[record * kRecord + j]);
}

bool touches(uvec2 bounds, uvec2 corner)
{
    return (bounds.x & 0xffff) < corner.x + 8 && bounds.x >> 16 >= corner.x && (bounds.y & 0xffff) < corner.y + 4 &&
           bounds.y >> 16 >= corner.y;
}

// what was fetched becomes the thread's record of the batch
void put(uvec2 corner, uint turn)
{
    const uint t = gl_LocalInvocationID.x;
    const uvec2 bounds = floatBitsToUint(ahead[0].zw);
    const bool upper = touches(bounds, corner), lower = touches(bounds, corner + uvec2(0, 4));
    if (!upper && !lower)
        return;
    if (upper)
        atomicOr(touching[turn][t / 32], 1u << t % 32);
    if (lower)
        atomicOr(touching[turn][2 + t / 32], 1u << t % 32);
    const vec3 normal = unpack_normal(floatBitsToUint(ahead[3].w));
    batch[t * kRecord] = vec4(ahead[0].xy, normal.xy);
    batch[t * kRecord + 1] = ahead[1];
    batch[t * kRecord + 2] = ahead[2];
    batch[t * kRecord + 3] = vec4(ahead[3].xyz, normal.z);
}

Splat splat_of(uint i)
{
    const vec4 t0 = batch[i * kRecord], t1 = batch[i * kRecord + 1];
    const vec4 t2 = batch[i * kRecord + 2], t3 = batch[i * kRecord + 3];
    return Splat(t0.xy, t1, t2.xy, t2.z, t2.w, t3.rgb, vec3(t0.zw, t3.w));
}

void main()
{
    const uint camera = gl_WorkGroupID.z, t = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 8, own = corner + uvec2(t % 8, t / 8), tile_at = corner / p.tile;
    const uint tile = (camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x, end = starts[tile + 1];
    const vec2 at = vec2(own) + 0.5;
    const float limit = limit_of(own, camera);
    Pixel pixel = empty_pixel(); // its record is a place in the list until the end
    if (own.x >= p.width || own.y >= p.height)
        pixel.transmittance = -1.0;
    uint i = starts[tile], turn = 0;
    uint record = pair_at(i + t, end), following = pair_at(i + kBatch + t, end);
    fetch(record);
    living[0] = 1;
    if (t < 4)
        touching[0][t] = 0;
    barrier();
    for (; i < end && living[turn] != 0; i += kBatch, turn ^= 1) {
        if (t < 4)
            touching[turn ^ 1][t] = 0;
        if (t == 0)
            living[turn ^ 1] = 0;
        if (record != kNone)
            put(corner, turn);
        barrier();
        record = following;
        following = pair_at(i + 2 * kBatch + t, end);
        fetch(record);
        for (uint word = 0; word < 2; ++word) {
            uint bits = touching[turn][t / 32 * 2 + word];
            while (bits != 0 && pixel.transmittance > 0.0) {
                const uint j = word * 32 + findLSB(bits);
                bits &= bits - 1;
                const bool two = bits != 0;
                const uint k = two ? word * 32 + findLSB(bits) : j;
                bits &= bits - 1;
                const Splat nearer = splat_of(j);
                Splat farther = splat_of(k);
                farther.opacity = two ? farther.opacity : -1.0; // not seen
                blend(pixel, nearer, at, i + j, limit);
                blend(pixel, farther, at, i + k, limit);
            }
        }
        if (pixel.transmittance > 0.0)
            living[turn ^ 1] = 1;
        barrier();
    }
    if (pixel.record != kNone)
        pixel.record = pairs[pixel.record];
    store(pixel, own, camera);
}
