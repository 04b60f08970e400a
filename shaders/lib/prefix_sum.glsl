// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what every pass of the prefix sum shares: which elements there are, and which of them a worker owns
layout(constant_id = 2) const bool kCounted = false;   // only the first count[0] elements are there
layout(constant_id = 3) const bool kNonZero = false;   // counts the elements that are not zero instead of adding them
layout(push_constant) uniform Push { PrefixSumPush p; };
layout(binding = 0) readonly buffer X { uint x[]; };         // [size]
layout(binding = 1) readonly buffer Count { uint count[]; }; // [1]

uint term(uint i) { return kNonZero ? uint(x[i] != 0) : x[i]; }

// [first, last) of a worker
uvec2 chunk_of(uint worker)
{
    const uint size = kCounted ? min(count[0], p.size) : p.size;
    const uint chunk = (size + p.workers - 1) / p.workers;
    return min(uvec2(worker, worker + 1) * chunk, uvec2(size));
}
