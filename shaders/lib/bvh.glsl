// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Nearest triangle along a ray, through the tree of engine/mesh/bvh.h. To be included after the declaration of
//   nodes[]     uvec4, four a node
//   triangles[] vec4, three a triangle: corner, edge to the second, edge to the third corner; w belongs to the shader
struct Ray {
    vec3 origin, direction;
    float near, far;
};

struct Hit {
    float t; // of the direction's length; the ray's far end where nothing is hit
    uint triangle;
    float u, v; // weights of the second and third corner
};

const uint kNoTriangle = 0xffffffffu, kLeafBit = 0x80000000u;
const uint kStackSize = 48; // kBvhDepth

// Nodes that are left for later, a column for each thread: in registers they are more than some GPUs have for a thread.
// No thread reads another's, so there is no barrier.
shared uint bvh_stack[kStackSize * gl_WorkGroupSize.x];
#define BVH_STACK(depth) bvh_stack[(depth) * gl_WorkGroupSize.x + gl_LocalInvocationIndex]

// note: a component of 0 becomes a tiny one, so that no product is 0 x infinity
vec3 safe_inverse(vec3 d)
{
    const vec3 tiny = vec3(1e-18);
    return 1.0 / mix(d, mix(tiny, -tiny, lessThan(d, vec3(0.0))), lessThan(abs(d), tiny));
}

// where a ray enters a box, or kMiss; a little wide, because the slabs are rounded
const float kMiss = 3e38;
float enter_box(vec3 low, vec3 high, vec3 origin, vec3 inverse, float near, float far)
{
    const vec3 a = (low - origin) * inverse, b = (high - origin) * inverse;
    const vec3 first = min(a, b), last = max(a, b);
    const float enter = max(max(first.x, first.y), max(first.z, near));
    const float leave = min(min(last.x, last.y), min(last.z, far));
    return enter <= leave * 1.000001 + 1e-7 ? enter : kMiss;
}

// Moller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997; edges belong to the triangle
void intersect_triangle(uint index, Ray ray, inout Hit hit)
{
    const vec3 corner = triangles[3 * index].xyz, e1 = triangles[3 * index + 1].xyz, e2 = triangles[3 * index + 2].xyz;
    const vec3 p = cross(ray.direction, e2);
    const float det = dot(e1, p);
    if (det == 0.0)
        return;
    const float scale = 1.0 / det;
    const vec3 s = ray.origin - corner;
    const float u = dot(s, p) * scale;
    const vec3 q = cross(s, e1);
    const float v = dot(ray.direction, q) * scale, t = dot(e2, q) * scale;
    if (u >= -1e-6 && v >= -1e-6 && u + v <= 1.000001 && t > ray.near && t < hit.t)
        hit = Hit(t, index, u, v);
}

// any: the first triangle found will do
Hit trace(Ray ray, bool any)
{
    Hit hit = Hit(ray.far, kNoTriangle, 0.0, 0.0);
    const vec3 inverse = safe_inverse(ray.direction);
    uint depth = 0, at = 0;
    for (;;) {
        if ((at & kLeafBit) != 0) {
            const uint first = at & 0x0fffffffu, count = (at >> 28) & 7u;
            for (uint i = 0; i < count; ++i)
                intersect_triangle(first + i, ray, hit);
            if (depth == 0 || (any && hit.triangle != kNoTriangle))
                break;
            at = BVH_STACK(--depth);
            continue;
        }
        const uvec4 a = nodes[4 * at], b = nodes[4 * at + 1], c = nodes[4 * at + 2], d = nodes[4 * at + 3];
        const float left =
            enter_box(uintBitsToFloat(a.xyz), uintBitsToFloat(b.xyz), ray.origin, inverse, ray.near, hit.t);
        const float right =
            enter_box(uintBitsToFloat(c.xyz), uintBitsToFloat(d.xyz), ray.origin, inverse, ray.near, hit.t);
        const bool left_first = left <= right;
        const float nearer = min(left, right), farther = max(left, right);
        if (nearer == kMiss) {
            if (depth == 0)
                break;
            at = BVH_STACK(--depth);
            continue;
        }
        at = left_first ? a.w : b.w;
        if (farther != kMiss && depth < kStackSize)
            BVH_STACK(depth++) = left_first ? b.w : a.w;
    }
    return hit;
}
