// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what both passes of a digit share: which pairs there are, which of them a worker owns, and their digits
layout(constant_id = 2) const bool kCounted = false; // only the first count[0] pairs are there
layout(constant_id = 3) const bool kIota = false;    // the value of pair i is i
layout(push_constant) uniform Push { RadixSortPush p; };
layout(binding = 0) readonly buffer Keys { uint keys[]; };   // [size]
layout(binding = 1) readonly buffer Count { uint count[]; }; // [1]

uint digit_of(uint key) { return key >> p.shift & p.buckets - 1; }

const uint kSortTile = 3072; // pairs that a workgroup of a GPU takes at a time

// [first, last) of a worker
uvec2 chunk_of(uint worker)
{
    const uint size = kCounted ? min(count[0], p.size) : p.size;
    uint chunk = (size + p.workers - 1) / p.workers;
#ifdef CHUNK_OF_TILES // whole tiles: then some workers may have none
    chunk = (chunk + kSortTile - 1) / kSortTile * kSortTile;
#endif
    return min(uvec2(worker, worker + 1) * chunk, uvec2(size));
}
