#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the nearest triangle of points in a tree of boxes, and y's if that is nearer, ties to the lower face; the nearer
// child first
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform SurfaceDistancePush {
    uint size; // points
    uint points_ld;
} p;
layout(binding = 0) readonly buffer Points { float points[]; };       // [size, points_ld]
layout(binding = 1) readonly buffer Nodes { uvec4 nodes[]; };         // [4 * nodes] as engine/mesh/bvh.h
layout(binding = 2) readonly buffer Triangles { uint triangles[]; };  // [T, 10]
layout(binding = 3) buffer Y { uvec2 y[]; };                          // [size] distance as bits, face

const uint kStack = 48, kLeafBit = 0x80000000u; // engine/mesh/bvh.h: kBvhDepth, kBvhLeaf

// nodes that wait, a column for each thread, as in lib/bvh.glsl
shared uint waiting[kStack * gl_WorkGroupSize.x];
#define WAITING(depth) waiting[(depth) * gl_WorkGroupSize.x + gl_LocalInvocationIndex]

vec3 corner(uint t, uint c)
{
    const uint at = 10 * t + 3 * c;
    return uintBitsToFloat(uvec3(triangles[at], triangles[at + 1], triangles[at + 2]));
}

float square(vec3 v) { return dot(v, v); }

float segment2(vec3 p, vec3 a, vec3 b)
{
    const vec3 ab = b - a;
    const float length2 = dot(ab, ab);
    const float t = length2 > 0.0 ? clamp(dot(p - a, ab) / length2, 0.0, 1.0) : 0.0;
    return square(p - a - t * ab);
}

// above the triangle's inside the distance to its plane, else to the nearest edge
float triangle2(vec3 p, vec3 a, vec3 b, vec3 c)
{
    const vec3 ab = b - a, bc = c - b, ca = a - c, n = cross(ab, -ca);
    const float n2 = dot(n, n);
    const bool inside = n2 > 0.0 && dot(cross(ab, p - a), n) >= 0.0 && dot(cross(bc, p - b), n) >= 0.0 &&
                        dot(cross(ca, p - c), n) >= 0.0;
    if (inside) {
        const float height = dot(p - a, n);
        return height * height / n2;
    }
    return min(min(segment2(p, a, b), segment2(p, b, c)), segment2(p, c, a));
}

float box2(uvec4 low, uvec4 high, vec3 p)
{
    return square(max(max(uintBitsToFloat(low.xyz) - p, p - uintBitsToFloat(high.xyz)), vec3(0)));
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.size)
        return;
    const vec3 point = vec3(points[i * p.points_ld], points[i * p.points_ld + 1], points[i * p.points_ld + 2]);
    uint face = y[i].y;
    float best = uintBitsToFloat(y[i].x);
    best *= best;
    bool found = false;
    uint top = 0, at = 0;
    for (;;) {
        if ((at & kLeafBit) != 0) {
            const uint first = at & 0x0fffffffu, count = (at >> 28) & 7u;
            for (uint t = first; t < first + count; ++t) {
                const float square = triangle2(point, corner(t, 0), corner(t, 1), corner(t, 2));
                const uint own = triangles[10 * t + 9];
                if (square > best || (square == best && own >= face))
                    continue;
                best = square;
                face = own;
                found = true;
            }
        } else {
            const uvec4 a = nodes[4 * at], b = nodes[4 * at + 1], c = nodes[4 * at + 2], d = nodes[4 * at + 3];
            const float left = box2(a, b, point), right = box2(c, d, point);
            const bool left_first = left <= right;
            if (max(left, right) <= best && top < kStack)
                WAITING(top++) = left_first ? b.w : a.w;
            if (min(left, right) <= best) {
                at = left_first ? a.w : b.w;
                continue;
            }
        }
        if (top == 0)
            break;
        at = WAITING(--top);
    }
    if (found)
        y[i] = uvec2(floatBitsToUint(sqrt(best)), face);
}
