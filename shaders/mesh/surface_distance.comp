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
layout(binding = 1) readonly buffer Nodes { uvec4 nodes[]; };         // [2 * nodes] as kernels/mesh.h, SurfaceTree
layout(binding = 2) readonly buffer Triangles { uint triangles[]; };  // [T, 10]
layout(binding = 3) buffer Y { uvec2 y[]; };                          // [size] distance as bits, face

const uint kStack = 48; // levels of the tree

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

float box2(uint node, vec3 p)
{
    const vec3 low = uintBitsToFloat(nodes[2 * node].xyz), high = uintBitsToFloat(nodes[2 * node + 1].xyz);
    return square(max(max(low - p, p - high), vec3(0)));
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
    uint stack[kStack];
    uint top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const uint node = stack[--top];
        if (box2(node, point) > best)
            continue;
        const uint link = nodes[2 * node].w, count = nodes[2 * node + 1].w;
        for (uint t = link; t < link + count; ++t) {
            const float square = triangle2(point, corner(t, 0), corner(t, 1), corner(t, 2));
            const uint own = triangles[10 * t + 9];
            if (square > best || (square == best && own >= face))
                continue;
            best = square;
            face = own;
            found = true;
        }
        if (count > 0 || top + 2 > kStack)
            continue;
        const bool left_first = box2(node + 1, point) <= box2(link, point);
        stack[top++] = left_first ? link : node + 1;
        stack[top++] = left_first ? node + 1 : link;
    }
    if (found)
        y[i] = uvec2(floatBitsToUint(sqrt(best)), face);
}
