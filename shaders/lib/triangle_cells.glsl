// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the cells whose box the triangle's box and plane touch, within the range of its record
struct CellWalk {
    ivec3 low, high; // high is included
    vec3 normal;     // not unit
    float level;     // of the plane along the normal
    float reach;     // of a cell's half diagonal along the normal, and a little for rounding
};

CellWalk walk_of(vec3 a, vec3 b, vec3 c, uint range)
{
    CellWalk w;
    const ivec3 first = ivec3(range & 15u, range >> 4 & 15u, range >> 8 & 15u);
    const ivec3 last = ivec3(range >> 12 & 15u, range >> 16 & 15u, range >> 20 & 15u) - 1;
    w.low = max(ivec3(floor(min(min(a, b), c))), first);
    w.high = min(ivec3(floor(max(max(a, b), c))), last);
    w.normal = cross(b - a, c - a);
    const float size = abs(w.normal.x) + abs(w.normal.y) + abs(w.normal.z);
    w.level = dot(w.normal, a);
    w.reach = 0.5 * size + 1e-4 * (size + dot(abs(b - a), abs(b - a)) + dot(abs(c - a), abs(c - a)));
    return w;
}

bool touches(CellWalk w, ivec3 cell)
{
    return abs(dot(w.normal, vec3(cell) + 0.5) - w.level) <= w.reach;
}
