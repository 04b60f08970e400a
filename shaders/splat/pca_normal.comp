#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// normal = eigenvector of the smallest eigenvalue of the covariance of the neighbours, its largest component positive.
// With fallbacks (docs/method.md §5.1): along thin lines the part of p - mean that is across the line; without
// a plane, up.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/eigen3.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kFallbacks = false;
layout(constant_id = 1) const bool kLabels = false;
layout(push_constant) uniform PcaNormalPush {
    uint rows;        // points
    uint points_ld;   // floats from one point to the next
    uint neighbors;   // of a point
    uint line_labels; // bit per label: long and thin things
} p;
layout(binding = 0) readonly buffer Points { float points[]; };         // [rows, points_ld]
layout(binding = 1) readonly buffer Neighbors { uint neighbors[]; };    // [rows, neighbors]
layout(binding = 2) readonly buffer Labels { uint labels[]; };          // [rows]
layout(binding = 3) writeonly buffer Normals { vec4 normals[]; };       // [rows] normal; 0 plane, 1 line, 2 neither
layout(binding = 4) writeonly buffer Eigenvalues { vec4 eigenvalues[]; }; // [rows] m^2, ascending; number of neighbours

const uint kNone = 0xffffffffu;

vec3 point(uint i)
{
    const uint at = i * p.points_ld;
    return vec3(points[at], points[at + 1], points[at + 2]);
}

// mean of the neighbours relative to `origin`, which keeps fp32 exact far from the world's origin
vec3 mean_offset(uint row, vec3 origin, out uint count)
{
    vec3 sum = vec3(0.0);
    count = 0;
    for (uint q = 0; q < p.neighbors; ++q) {
        const uint j = neighbors[row * p.neighbors + q];
        if (j == kNone)
            continue;
        sum += point(j) - origin;
        ++count;
    }
    return sum / float(max(count, 1));
}

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    uint count;
    const vec3 origin = point(row), mean = mean_offset(row, origin, count);
    vec3 diagonal = vec3(0.0), off = vec3(0.0); // off: xy, xz, yz
    for (uint q = 0; q < p.neighbors; ++q) {
        const uint j = neighbors[row * p.neighbors + q];
        if (j == kNone)
            continue;
        const vec3 d = point(j) - origin - mean;
        diagonal += d * d;
        off += d.xxy * d.yzz;
    }
    const float trace = diagonal.x + diagonal.y + diagonal.z, scale = trace > 1e-30 ? 1.0 / trace : 0.0;
    vec3 values;
    mat3 axes;
    eigen_symmetric3(diagonal * scale, off.x * scale, off.y * scale, off.z * scale, values, axes);
    vec3 normal = axes[0];
    float kind = 0.0;
    if (kFallbacks) {
        const bool line_label = kLabels && labels[row] < 32 && (p.line_labels >> labels[row] & 1) != 0;
        const vec3 across = -mean - axes[2] * dot(-mean, axes[2]);
        const float across2 = dot(across, across);
        if (values.y < (line_label ? 0.5 : 0.2) * values.z && across2 > 1e-6 * trace) {
            normal = across * inversesqrt(across2);
            kind = 1.0;
        }
        if (count < 3 || scale == 0.0) {
            normal = vec3(0, 0, 1);
            kind = 2.0;
        }
    }
    const vec3 size = abs(normal);
    const float largest = size.x >= size.y && size.x >= size.z ? normal.x : size.y >= size.z ? normal.y : normal.z;
    normals[row] = vec4(largest < 0.0 ? -normal : normal, kind);
    eigenvalues[row] = vec4(values * (trace / float(max(count, 1))), float(count));
}
