// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// A triangle clipped to the unit cell [0, 1)^3 (Sutherland and Hodgman, 1974). Half-open: what lies in a plane between
// two voxels belongs to the upper one, so that no area is counted twice or lost. Everything is `precise`: two shaders
// that clip the same triangle get the same polygon.

const uint kMaxCorners = 11; // 3 and one for each plane; the rest is for corners that rounding puts astride a plane

vec3 polygon[kMaxCorners];
uint polygon_size;

// keeps what is at or above `bound` along an axis, or below it
void clip_plane(uint axis, float bound, bool below)
{
    vec3 kept[kMaxCorners];
    uint n = 0;
    for (uint i = 0; i < polygon_size; ++i) {
        const vec3 a = polygon[i], b = polygon[i + 1 < polygon_size ? i + 1 : 0];
        precise float da = below ? bound - a[axis] : a[axis] - bound;
        precise float db = below ? bound - b[axis] : b[axis] - bound;
        const bool in_a = below ? da > 0.0 : da >= 0.0, in_b = below ? db > 0.0 : db >= 0.0;
        if (in_a && n < kMaxCorners)
            kept[n++] = a;
        if (in_a != in_b && n < kMaxCorners) { // from the inside out, so that both sides find nearly the same point
            const vec3 from = in_a ? a : b, to = in_a ? b : a;
            precise float t = in_a ? da / (da - db) : db / (db - da);
            precise vec3 p = from + t * (to - from);
            p[axis] = bound;
            kept[n++] = p;
        }
    }
    polygon = kept;
    polygon_size = n;
}

void clip_to_cell(vec3 a, vec3 b, vec3 c)
{
    polygon[0] = a;
    polygon[1] = b;
    polygon[2] = c;
    polygon_size = 3;
    for (uint axis = 0; axis < 3; ++axis) {
        clip_plane(axis, 0.0, false);
        clip_plane(axis, 1.0, true);
    }
}

// of the triangle that corners 0, i, i + 1 of the polygon make
float fan_area(uint i)
{
    precise vec3 u = polygon[i] - polygon[0], v = polygon[i + 1] - polygon[0];
    precise vec3 n = vec3(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x);
    precise float square = n.x * n.x + n.y * n.y + n.z * n.z;
    return 0.5 * sqrt(square);
}

float polygon_area()
{
    precise float sum = 0.0;
    for (uint i = 1; i + 1 < polygon_size; ++i)
        sum += fan_area(i);
    return sum;
}

// where `into` of the polygon's area is behind, seen from its first corner
vec3 point_in_polygon(float into, float outward)
{
    const float target = into * polygon_area();
    uint i = 1;
    float before = 0.0, area = fan_area(1);
    while (before + area <= target && i + 2 < polygon_size) {
        before += area;
        area = fan_area(++i);
    }
    const float r = sqrt(outward), s = area > 0.0 ? clamp((target - before) / area, 0.0, 1.0) : 0.0;
    return (1.0 - r) * polygon[0] + (r * (1.0 - s)) * polygon[i] + (r * s) * polygon[i + 1];
}
