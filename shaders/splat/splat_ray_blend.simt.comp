#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats over pixels of cameras with lenses, front to back, for GPUs: as splat_blend.simt.comp
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "splat.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 16; // pixel rows of a workgroup
layout(constant_id = 1) const uint kTileN = 16; // and columns
layout(binding = 0) readonly buffer Records { uvec4 records[]; }; // [max_visible, kTexels]
#include "lib/splat_ray.glsl"

const uint kOwn = 4;    // pixels of a thread, four rows apart
const uint kBatch = 64; // records in shared memory
shared uvec4 batch[kBatch * kTexels];
shared uint batch_record[kBatch];
shared uint living[2]; // threads with a pixel that is not done: of this batch and of the next, by turns

void load(uint i, uint end)
{
    const uint t = gl_LocalInvocationID.x;
    if (i + t < end) {
        const uint record = pairs[i + t];
        batch_record[t] = record;
        [[unroll]] for (uint j = 0; j < kTexels; ++j)
            batch[t * kTexels + j] = records[record * kTexels + j];
    }
}

void main()
{
    const uint camera = gl_WorkGroupID.z, t = gl_LocalInvocationID.x;
    const uvec2 corner = gl_WorkGroupID.yx * 16, own = corner + uvec2(t % 16, t / 16), tile_at = corner / p.tile;
    const uint tile = (camera * p.tiles_y + tile_at.y) * p.tiles_x + tile_at.x, end = starts[tile + 1];
    Pixel pixels[kOwn];
    Ray ray[kOwn];
    [[unroll]] for (uint y = 0; y < kOwn; ++y) {
        ray[y] = pixel_ray(own + uvec2(0, 4 * y), camera);
        pixels[y] = pixel_of_ray(ray[y]);
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
            const uint at = j * kTexels;
            vec4 drift = vec4(0.0);
            if (kMoving)
                drift = uintBitsToFloat(batch[at + 5]);
            const RaySplat s = read_splat(uintBitsToFloat(batch[at]), uintBitsToFloat(batch[at + 1]), uintBitsToFloat(batch[at + 2]),
                                          uintBitsToFloat(batch[at + 3]), uintBitsToFloat(batch[at + 4]), drift);
            [[unroll]] for (uint y = 0; y < kOwn; ++y)
                blend(pixels[y], s, ray[y], vec2(own + uvec2(0, 4 * y)) + 0.5, batch_record[j]);
        }
        float left = 0.0;
        [[unroll]] for (uint y = 0; y < kOwn; ++y)
            left = max(left, pixels[y].transmittance);
        if (left > 0.0)
            living[turn ^ 1] = 1;
        barrier();
    }
    [[unroll]] for (uint y = 0; y < kOwn; ++y)
        store_ray(pixels[y], own + uvec2(0, 4 * y), camera);
}
