// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// The voxels whose box the triangle's box and plane touch, within the range of its record. One pass counts them,
// another writes them: sums are `precise`, so that no compiler contracts them in one of the two alone.
struct CellWalk {
    ivec3 low, high; // high is included
    vec3 normal;     // not unit
    float level;     // of the plane along the normal
    float reach;     // of a voxel's half diagonal along the normal, and a little for rounding
};

float plane_dot(vec3 a, vec3 b)
{
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}

CellWalk walk_of(vec3 a, vec3 b, vec3 c, uint range)
{
    CellWalk w;
    const ivec3 first = ivec3(range & 15u, range >> 4 & 15u, range >> 8 & 15u);
    const ivec3 last = ivec3(range >> 12 & 15u, range >> 16 & 15u, range >> 20 & 15u) - 1;
    w.low = max(ivec3(floor(min(min(a, b), c))), first);
    w.high = min(ivec3(floor(max(max(a, b), c))), last);
    const vec3 u = b - a, v = c - a;
    precise vec3 normal = u.yzx * v.zxy - u.zxy * v.yzx;
    precise float size = abs(normal.x) + abs(normal.y) + abs(normal.z);
    precise float reach = 0.5 * size + 1e-4 * (size + plane_dot(u, u) + plane_dot(v, v));
    w.normal = normal;
    w.level = plane_dot(normal, a);
    w.reach = reach;
    return w;
}

bool touches(CellWalk w, ivec3 cell)
{
    return abs(plane_dot(w.normal, vec3(cell) + 0.5) - w.level) <= w.reach;
}
