#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// pair i goes to first[digit][worker] + pairs with that digit before it in the chunk; a worker is a workgroup that
// takes 1024 pairs at a time, sorts them stably by two nibbles in shared memory, so that equal digits leave side by
// side, and keeps its places in shared memory. 15.1 KiB; needs no subgroup operation.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "radix_sort.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 1; // workers of a workgroup
layout(constant_id = 1) const uint kTileN = 1;
#include "lib/radix_sort.glsl"
#include "lib/workgroup_scan.glsl"
layout(binding = 2) readonly buffer Values { uint values[]; };
layout(binding = 3) buffer First { uint first[]; }; // [buckets, workers]
layout(binding = 4) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 5) writeonly buffer SortedValues { uint sorted_values[]; };

const uint kOwn = 16;              // pairs of a thread
const uint kTile = 1024;           // of the workgroup
const uint kPadded = kTile + kTile / 16;
shared uint tile_keys[kPadded]; // at padded(i)
shared uint tile_values[kPadded];
shared uint counters[kPadded]; // [nibble][thread]
shared uint place[256];     // where the next pair of a digit goes
shared uint start[256];     // of a digit within the sorted tile

// A thread owns 16 elements in a row. A word after each 16 lets all threads' n-th ones lie in different banks.
uint padded(uint i) { return i + i / 16; }

void sort_nibble(uint shift)
{
    const uint t = gl_LocalInvocationID.x;
    uint key[kOwn], value[kOwn];
    [[unroll]] for (uint d = 0; d < 16; ++d)
        counters[padded(d * 64 + t)] = 0;
    [[unroll]] for (uint j = 0; j < kOwn; ++j) {
        key[j] = tile_keys[padded(t * kOwn + j)];
        value[j] = tile_values[padded(t * kOwn + j)];
        counters[padded((digit_of(key[j]) >> shift & 15) * 64 + t)] += 1;
    }
    barrier();
    uint sum = 0, total;
    [[unroll]] for (uint j = 0; j < 16; ++j)
        sum += counters[padded(t * 16 + j)];
    uint before = scan_workgroup(sum, total);
    [[unroll]] for (uint j = 0; j < 16; ++j) {
        const uint own = counters[padded(t * 16 + j)];
        counters[padded(t * 16 + j)] = before;
        before += own;
    }
    barrier();
    [[unroll]] for (uint j = 0; j < kOwn; ++j) {
        const uint counter = padded((digit_of(key[j]) >> shift & 15) * 64 + t);
        const uint to = counters[counter];
        counters[counter] = to + 1;
        tile_keys[padded(to)] = key[j];
        tile_values[padded(to)] = value[j];
    }
    barrier();
}

// what is beyond the chunk sorts behind everything: all bits set, and last
void load(uint base, uint last)
{
    for (uint i = gl_LocalInvocationID.x; i < kTile; i += 64) {
        const uint at = base + i;
        tile_keys[padded(i)] = at < last ? keys[at] : 0xffffffffu;
        tile_values[padded(i)] = kIota ? at : at < last ? values[at] : 0;
    }
    barrier();
}

void store(uint size)
{
    for (uint i = gl_LocalInvocationID.x; i < kTile; i += 64) {
        const uint d = digit_of(tile_keys[padded(i)]);
        if (i == 0 || digit_of(tile_keys[padded(i - 1)]) != d)
            start[d] = i;
    }
    barrier();
    for (uint i = gl_LocalInvocationID.x; i < size; i += 64) {
        const uint d = digit_of(tile_keys[padded(i)]), to = place[d] + i - start[d];
        sorted_keys[to] = tile_keys[padded(i)];
        sorted_values[to] = tile_values[padded(i)];
    }
    barrier();
    for (uint i = gl_LocalInvocationID.x; i < kTile; i += 64) {
        const uint d = digit_of(tile_keys[padded(i)]);
        if (i == kTile - 1 || digit_of(tile_keys[padded(i + 1)]) != d)
            place[d] += i + 1 - start[d];
    }
    barrier();
}

void main()
{
    const uint worker = gl_WorkGroupID.x;
    for (uint d = gl_LocalInvocationID.x; d < p.buckets; d += 64)
        place[d] = first[d * p.workers + worker];
    const uvec2 chunk = chunk_of(worker);
    for (uint base = chunk.x; base < chunk.y; base += kTile) {
        load(base, chunk.y);
        sort_nibble(0);
        if (p.buckets > 16)
            sort_nibble(4);
        store(min(chunk.y - base, kTile));
    }
}
