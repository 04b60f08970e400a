#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the k nearest points of every point, itself included, nearest first, ties by index. Shells of grid cells are searched
// outwards until no point beyond them can be nearer than the k-th; after kMaxShell of them, all points.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "knn.h"
#include "lib/grid_hash.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kNeighbors = 16;
layout(constant_id = 1) const bool kLabels = false;
layout(constant_id = 2) const bool kQueries = false; // neighbours of other points, which have no labels
layout(push_constant) uniform Push { KnnPush p; };
layout(binding = 0) readonly buffer Sorted { vec4 sorted_points[]; };        // [rows] xyz, index as bits
layout(binding = 1) readonly buffer SortedLabels { uint sorted_labels[]; }; // [rows]
layout(binding = 2) readonly buffer Starts { uint starts[]; };              // [buckets + 1]
layout(binding = 3) readonly buffer Queries { float queries[]; };           // [queries, queries_ld]
layout(binding = 4) writeonly buffer Neighbors { uint neighbors[]; };       // [rows or queries, kNeighbors]

const uint kNone = 0xffffffffu;
const int kMaxShell = 4;
const float kFar = 3e38;
const uint kAtOnce = 64;

float distance2[kNeighbors]; // of what was found so far, nearest first
uint found[kNeighbors];
vec3 own;
uint own_label;
bool same_label_only;

void clear()
{
    [[unroll]] for (uint q = 0; q < kNeighbors; ++q) {
        distance2[q] = kFar;
        found[q] = kNone;
    }
}

// note: a distance that is not finite is never nearer than anything
void offer(uint at, vec4 candidate)
{
    const vec3 d = candidate.xyz - own;
    float own_d = dot(d, d);
    uint own_i = floatBitsToUint(candidate.w);
    if (!(own_d <= p.radius2) || own_d > distance2[kNeighbors - 1])
        return;
    if (kLabels && same_label_only && sorted_labels[at] != own_label)
        return;
    [[unroll]] for (uint q = 0; q < kNeighbors; ++q) {
        const float d_q = distance2[q];
        const uint i_q = found[q];
        const bool nearer = own_d < d_q || (own_d == d_q && own_i < i_q);
        distance2[q] = nearer ? own_d : d_q;
        found[q] = nearer ? own_i : i_q;
        own_d = nearer ? d_q : own_d;
        own_i = nearer ? i_q : own_i;
    }
}

// cells whose largest coordinate differs from that of `center` by `shell`
void search_shell(ivec3 center, int shell)
{
    const uint side = 2 * shell + 1;
    for (uint c = 0; c < side * side * side; ++c) {
        const ivec3 d = ivec3(uvec3(c % side, c / side % side, c / (side * side))) - shell;
        if (max(max(abs(d.x), abs(d.y)), abs(d.z)) < shell)
            continue;
        const ivec3 cell = center + d;
        const uint bucket = grid_hash(cell) & p.mask, end = starts[bucket + 1];
        for (uint j = starts[bucket]; j < end; ++j) {
            const vec4 candidate = sorted_points[j];
            if (grid_cell(candidate.xyz, p.per_metre) == cell) // else the bucket holds another cell as well
                offer(j, candidate);
        }
    }
}

// note: lavapipe ends the loops of an invocation after 65535 rounds, all loops together, and says nothing. So a round
// looks at kAtOnce points, and few of them are looked at again. The round has no branch: with 64 of them SwiftShader's
// compiler took 8 GB and did not end.
void search_all()
{
    for (uint base = 0; base < p.rows; base += kAtOnce) {
        float nearest = kFar;
        [[unroll]] for (uint u = 0; u < kAtOnce; ++u) {
            const uint at = min(base + u, p.rows - 1);
            const vec3 d = sorted_points[at].xyz - own;
            float own_d = dot(d, d);
            if (kLabels) {
                const uint label = sorted_labels[at];
                own_d = same_label_only && label != own_label ? kFar : own_d;
            }
            nearest = own_d < nearest ? own_d : nearest;
        }
        if (nearest > distance2[kNeighbors - 1])
            continue;
        for (uint j = base; j < min(base + kAtOnce, p.rows); ++j)
            offer(j, sorted_points[j]);
    }
}

void search()
{
    clear();
    const ivec3 center = grid_cell(own, p.per_metre);
    const vec3 within = own - vec3(center) * p.cell_size, edge = min(within, p.cell_size - within);
    // distance from the point to the border of its cell, less what rounding can have moved other points across it
    const float margin = min(min(edge.x, edge.y), edge.z) - 1e-6 * (abs(own.x) + abs(own.y) + abs(own.z) + p.cell_size);
    for (int shell = 0; shell <= kMaxShell; ++shell) {
        search_shell(center, shell);
        const float certain = max(margin + float(shell) * p.cell_size, 0.0);
        if (certain * certain > min(distance2[kNeighbors - 1], p.radius2))
            return;
    }
    clear();
    search_all();
}

void main()
{
    const uint i = linear_thread();
    if (i >= (kQueries ? p.queries : p.rows))
        return;
    uint to = i;
    if (kQueries) {
        const uint at = i * p.queries_ld;
        own = vec3(queries[at], queries[at + 1], queries[at + 2]);
    } else {
        const vec4 point = sorted_points[i];
        own = point.xyz;
        own_label = sorted_labels[i];
        to = floatBitsToUint(point.w);
    }
    same_label_only = kLabels;
    for (uint attempt = 0; attempt < (kLabels ? 2 : 1); ++attempt) {
        search();
        uint n = 0;
        [[unroll]] for (uint q = 0; q < kNeighbors; ++q)
            n += uint(found[q] != kNone);
        if (n >= min(p.min_same_label, kNeighbors))
            break;
        same_label_only = false;
    }
    [[unroll]] for (uint q = 0; q < kNeighbors; ++q)
        neighbors[to * kNeighbors + q] = found[q];
}
