#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// point 0 of a set, then again and again the point that is farthest from those chosen, ties to the lower index. A
// workgroup has a set; every thread keeps the distances of every 64th point. Dispatches follow one another with the
// distances.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;
layout(push_constant) uniform FarthestPointPush {
    uint count;   // points of a set
    uint samples; // of a set, to choose
    uint first;   // of the samples, those of this dispatch
    uint end;
} p;
layout(binding = 0) readonly buffer Points { vec4 points[]; };      // [sets * count] xyz
layout(binding = 1) buffer Distances { uint distances[]; };         // [sets * count] squared, bits of floats
layout(binding = 2) writeonly buffer Index { uint chosen_index[]; }; // [sets * samples] within the set
layout(binding = 3) writeonly buffer Centers { vec4 centers[]; };   // [sets * samples] their points

shared float best_distance[64];
shared uint best_index[64];

// over all threads
uint farthest(float distance2, uint index)
{
    best_distance[gl_LocalInvocationID.x] = distance2;
    best_index[gl_LocalInvocationID.x] = index;
    barrier();
    distance2 = best_distance[0];
    index = best_index[0];
    for (uint t = 1; t < 64; ++t) {
        const float other = best_distance[t];
        if (other > distance2 || (other == distance2 && best_index[t] < index)) {
            distance2 = other;
            index = best_index[t];
        }
    }
    barrier();
    return index;
}

void main()
{
    const uint set = gl_WorkGroupID.x, thread = gl_LocalInvocationID.x;
    const uint first = set * p.count;
    uint chosen = 0;
    if (p.first > 0) { // what the dispatch before would have chosen next
        float own = -1.0;
        uint own_index = 0;
        for (uint i = thread; i < p.count; i += 64) {
            const float distance2 = uintBitsToFloat(distances[first + i]);
            if (distance2 > own) {
                own = distance2;
                own_index = i;
            }
        }
        chosen = farthest(own, own_index);
    }
    for (uint s = p.first; s < p.end; ++s) {
        const vec4 center = points[first + chosen];
        if (thread == 0) {
            chosen_index[set * p.samples + s] = chosen;
            centers[set * p.samples + s] = center;
        }
        float own = -1.0;
        uint own_index = 0;
        for (uint i = thread; i < p.count; i += 64) {
            const vec3 d = points[first + i].xyz - center.xyz;
            const float distance2 = min(uintBitsToFloat(distances[first + i]), dot(d, d));
            distances[first + i] = floatBitsToUint(distance2);
            if (distance2 > own) {
                own = distance2;
                own_index = i;
            }
        }
        chosen = farthest(own, own_index);
    }
}
