#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = page[address[i] - first] where that is in the page; y stays as it is elsewhere
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kCounted = false; // only the first count[0] addresses are there
layout(push_constant) uniform GatherTexelsPush {
    uint size;  // addresses
    uint first; // address of the page's first texel
    uint texels;
} p;
layout(binding = 0) readonly buffer Addresses { uint addresses[]; }; // [size]
layout(binding = 1) readonly buffer Page { uint page[]; };           // [texels]
layout(binding = 2) readonly buffer Count { uint count[]; };         // [1]
layout(binding = 3) buffer Y { uint y[]; };                          // [size]

void main()
{
    const uint i = linear_thread();
    if (i >= (kCounted ? min(count[0], p.size) : p.size))
        return;
    const uint at = addresses[i] - p.first; // wraps below the page
    y[i] = at < p.texels ? page[at] : y[i];
}
