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
