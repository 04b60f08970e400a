#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels, front to back, for GPUs: a workgroup of 64 threads owns 16 x 16 pixels, four a thread, and walks
// the list of its tile through 64 records in shared memory, until the list or its last pixel is done
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "splat.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 16; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 16; // and columns
layout(binding = 0) readonly buffer Records { uvec4 records[]; }; // [max_visible, kRecord]
#include "lib/splat_blend.glsl"

const uint kOwn = 4;    // pixels of a thread, four rows apart
const uint kBatch = 64; // records in shared memory
shared uvec4 batch[kBatch * kRecord];
shared uint batch_record[kBatch];
shared uint living[2]; // threads with a pixel that is not done: of this batch and of the next, by turns

void load(uint i, uint end)
{
    const uint t = gl_LocalInvocationID.x;
    if (i + t < end) {
        const uint record = pairs[i + t];
        batch_record[t] = record;
        [[unroll]] for (uint j = 0; j < kRecord; ++j)
            batch[t * kRecord + j] = records[record * kRecord + j];
    }
}

void main()
{
    const uint camera = gl_WorkGroupID.z, t = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 16, own = corner + uvec2(t % 16, t / 16), tile_at = corner / p.tile;
    const uint tile = (camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x, end = starts[tile + 1];
    Pixel pixels[kOwn];
    float limits_of_rows[kOwn];
    [[unroll]] for (uint y = 0; y < kOwn; ++y) {
        pixels[y] = empty_pixel();
        limits_of_rows[y] = limit_of(own + uvec2(0, 4 * y), camera);
    }
    living[0] = 1;
    uint turn = 0;
    for (uint i = starts[tile]; i < end; i += kBatch, turn ^= 1) {
        load(i, end);
        barrier();
        if (living[turn] == 0)
            break; // the same for all threads
        if (t == 0)
            living[turn ^ 1] = 0;
        barrier();
        for (uint j = 0; j < min(end - i, kBatch); ++j) {
            const Splat s = read_splat(uintBitsToFloat(batch[j * kRecord]), uintBitsToFloat(batch[j * kRecord + 1]),
                                       uintBitsToFloat(batch[j * kRecord + 2]), uintBitsToFloat(batch[j * kRecord + 3]));
            [[unroll]] for (uint y = 0; y < kOwn; ++y)
                blend(pixels[y], s, vec2(own + uvec2(0, 4 * y)) + 0.5, batch_record[j], limits_of_rows[y]);
        }
        float left = 0.0;
        [[unroll]] for (uint y = 0; y < kOwn; ++y)
            left = max(left, pixels[y].transmittance);
        if (left > 0.0)
            living[turn ^ 1] = 1;
        barrier();
    }
    [[unroll]] for (uint y = 0; y < kOwn; ++y)
        store(pixels[y], own + uvec2(0, 4 * y), camera);
}
