// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what every variant for cooperative matrices has: their shape, and subgroups that each own a part of shared memory
layout(constant_id = 30) const uint kMatM = 16; // 8 or 16
layout(constant_id = 31) const uint kMatN = 16; // 8 or 16
layout(constant_id = 32) const uint kMatK = 16; // divides 32
layout(constant_id = 33) const uint kThreads = 128;

// what a subgroup wrote to its part, the others do not see
void own_barrier()
{
    subgroupMemoryBarrierShared();
    subgroupBarrier();
}

// eight floats of an array in shared memory
#define READ8(values, at, lo, hi)                                                                                      \
    lo = vec4(values[at], values[(at) + 1], values[(at) + 2], values[(at) + 3]);                                       \
    hi = vec4(values[(at) + 4], values[(at) + 5], values[(at) + 6], values[(at) + 7])
