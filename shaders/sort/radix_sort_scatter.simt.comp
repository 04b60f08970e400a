#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// pair i goes to first[digit][worker] + pairs with that digit before it in the chunk; a worker is a workgroup that
// takes 3072 pairs at a time and sorts them stably by their digit: each row of 32 threads or more counts its own keys,
// a subgroup at a time, whose threads with the same digit find each other by ballots. Keys and then values pass through
// shared memory, so that equal digits leave side by side. 13.3 KiB. Right at any subgroup size; a stable sort has one
// result.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "radix_sort.h"

layout(local_size_x = 256) in;
layout(constant_id = 0) const uint kWorkers = 1; // workers of a workgroup
#define CHUNK_OF_TILES
#include "lib/radix_sort.glsl"
layout(binding = 2) readonly buffer Values { uint values[]; };
layout(binding = 3) buffer First { uint first[]; }; // [buckets, workers]
layout(binding = 4) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 5) writeonly buffer SortedValues { uint sorted_values[]; };

const uint kThreads = 256;
const uint kOwn = 12; // pairs of a thread
const uint kRows = 8; // at most
shared uint scratch[kSortTile];  // counters [row][digit]; then keys, then values, by their places in the sorted tile
shared uint base[256];           // of a digit: where the pairs of the sorted tile go, less their place in it
shared uint sums[kThreads / 4];  // of each subgroup

// Threads are numbered by subgroup. gl_SubgroupSize may be more than there are; every subgroup is full.
const uint kLeast = 32; // threads of a row
uint lanes() { return kThreads / gl_NumSubgroups; }
uint thread() { return gl_SubgroupID * lanes() + gl_SubgroupInvocationID; }
uint row_threads() { return max(lanes(), kLeast); }

uint count_bits(uvec4 mask)
{
    const ivec4 n = bitCount(mask);
    return uint(n.x + n.y + n.z + n.w);
}

// threads of the subgroup before this one that have its digit | number of all that have it << 16 in the first of them
uint rank_in_subgroup(uint digit)
{
    uvec4 same = subgroupBallot(true);
    [[unroll]] for (uint b = 0; b < 8; ++b) {
        const uint bit = digit >> b & 1;
        same &= subgroupBallot(bit != 0) ^ (bit - 1);
    }
    const uint before = count_bits(same & gl_SubgroupLtMask);
    return before == 0 ? count_bits(same) << 16 : before;
}

// the sum over the threads before this one
uint scan(uint value)
{
    uint before = subgroupExclusiveAdd(value);
    if (gl_SubgroupInvocationID == lanes() - 1)
        sums[gl_SubgroupID] = before + value;
    barrier();
    for (uint i = 0; i < gl_SubgroupID; ++i)
        before += sums[i];
    return before;
}

// rank[j]: as rank_in_subgroup() gives it; becomes the number of the row's pairs before it that have its digit. Subgroups
// of a row take turns, and meet every subgroupBarrier() together: Mesa 26's lavapipe makes it wait for the workgroup.
void rank_in_row(uint key[kOwn], inout uint rank[kOwn])
{
    const uint counters = thread() / row_threads() * 256, turns = row_threads() / lanes();
    for (uint turn = 0; turn < turns; ++turn) {
        const bool own = gl_SubgroupID % turns == turn;
        [[unroll]] for (uint j = 0; j < kOwn; ++j) {
            const uint counter = counters + digit_of(key[j]);
            uint before = 0;
            if (own)
                before = scratch[counter];
            subgroupBarrier();
            if (own && rank[j] >> 16 != 0)
                scratch[counter] = before + (rank[j] >> 16);
            subgroupBarrier();
            rank[j] = own ? before + (rank[j] & 0xffff) : rank[j];
        }
        barrier();
    }
}

// Counters become places in the sorted tile of a row's first pairs. A thread does those of the digit with its number;
// `place`: where the next of these goes.
void place_rows(inout uint place)
{
    const uint d = thread();
    uint before[kRows], sum = 0;
    [[unroll]] for (uint r = 0; r < kRows; ++r) {
        before[r] = sum;
        sum += scratch[r * 256 + d];
    }
    const uint start = scan(sum);
    [[unroll]] for (uint r = 0; r < kRows; ++r)
        scratch[r * 256 + d] = start + before[r];
    base[d] = place - start;
    place += sum;
    barrier();
}

// What is beyond the chunk sorts behind everything: all bits set, and last. It is not stored: threads beyond the end
// store the last pair again, so that loops that are unrolled have no branches.
void move_tile(uint from, uint end, inout uint place)
{
    const uint t = thread(), own = from + gl_SubgroupID * lanes() * kOwn + gl_SubgroupInvocationID, last = end - 1;
    uint key[kOwn], value[kOwn], rank[kOwn], to[kOwn];
    [[unroll]] for (uint j = 0; j < kOwn; ++j) {
        const uint at = own + j * lanes(), there = keys[min(at, last)];
        key[j] = at > last ? 0xffffffffu : there;
    }
    if (kIota) {
        [[unroll]] for (uint j = 0; j < kOwn; ++j)
            value[j] = own + j * lanes();
    } else {
        [[unroll]] for (uint j = 0; j < kOwn; ++j)
            value[j] = values[min(own + j * lanes(), last)];
    }
    [[unroll]] for (uint r = 0; r < kRows; ++r)
        scratch[r * 256 + t] = 0;
    [[unroll]] for (uint j = 0; j < kOwn; ++j)
        rank[j] = rank_in_subgroup(digit_of(key[j]));
    barrier();
    rank_in_row(key, rank);
    place_rows(place);
    const uint counters = t / row_threads() * 256;
    [[unroll]] for (uint j = 0; j < kOwn; ++j)
        rank[j] += scratch[counters + digit_of(key[j])];
    barrier();
    [[unroll]] for (uint j = 0; j < kOwn; ++j)
        scratch[rank[j]] = key[j];
    barrier();
    [[unroll]] for (uint j = 0; j < kOwn; ++j) {
        const uint i = min(j * kThreads + t, last - from), sorted = scratch[i];
        to[j] = base[digit_of(sorted)] + i;
        sorted_keys[to[j]] = sorted;
    }
    barrier();
    [[unroll]] for (uint j = 0; j < kOwn; ++j)
        scratch[rank[j]] = value[j];
    barrier();
    [[unroll]] for (uint j = 0; j < kOwn; ++j)
        sorted_values[to[j]] = scratch[min(j * kThreads + t, last - from)];
    barrier();
}

void main()
{
    const uint worker = gl_WorkGroupID.x;
    const uvec2 chunk = chunk_of(worker);
    uint place = thread() < p.buckets ? first[thread() * p.workers + worker] : 0;
    for (uint from = chunk.x; from < chunk.y; from += kSortTile)
        move_tile(from, chunk.y, place);
}
