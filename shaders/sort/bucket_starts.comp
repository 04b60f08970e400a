#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// starts[b] = how many of the sorted keys are below b, by binary search: no start is left unwritten, however few keys
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kCounted = false; // only the first count[0] keys are there
layout(push_constant) uniform BucketStartsPush {
    uint size; // capacity of keys
    uint buckets;
} p;
layout(binding = 0) readonly buffer Keys { uint keys[]; };       // [size]
layout(binding = 1) readonly buffer Count { uint count[]; };     // [1]
layout(binding = 2) writeonly buffer Starts { uint starts[]; }; // [buckets + 1]

void main()
{
    const uint bucket = linear_thread();
    if (bucket > p.buckets)
        return;
    uint low = 0, high = kCounted ? min(count[0], p.size) : p.size;
    while (low < high) {
        const uint middle = (low + high) / 2;
        if (keys[middle] < bucket)
            low = middle + 1;
        else
            high = middle;
    }
    starts[bucket] = low;
}
