// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// sums over the 64 threads of a workgroup through shared memory: right at any subgroup size
shared uint scan_sums[64];

// the sum over the threads before this one; total is the sum over all. Every thread must call it.
uint scan_workgroup(uint value, out uint total)
{
    const uint t = gl_LocalInvocationID.x;
    scan_sums[t] = value;
    barrier();
    for (uint step = 1; step < 64; step *= 2) {
        const uint before = t >= step ? scan_sums[t - step] : 0;
        barrier();
        scan_sums[t] += before;
        barrier();
    }
    total = scan_sums[63];
    const uint sum = scan_sums[t] - value;
    barrier(); // the next call writes again
    return sum;
}
