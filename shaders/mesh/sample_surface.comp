#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// points drawn uniformly from the surface in a voxel, evenly: sample k of n of a voxel is (x + k / n, y + k / phi)
// modulo 1, a lattice (Kronecker's, with the golden ratio phi) that two random words of the voxel shift (Cranley and
// Patterson 1976). x is the share of the area before the point, across pairs and the fans of their polygons; the root
// of y how far it lies from the fan's corner. Each point by itself is uniform; together they leave smaller gaps than
// independent ones. And what a point's colour is made of.
// kMasked: materials have alpha. Areas are those of what is a surface; a point that falls on none is drawn again within
// its share of the area.
// kCanonical: nothing is random. Where a voxel's surface faces one axis, sample k lies at place k of a grid of rows
// over the voxel, seen along that axis, on what is outermost there. Elsewhere, and where nothing is, the lattice's
// shift is a constant.
#extension GL_GOOGLE_include_directive : require
#include "lib/clip_cell.glsl"
#include "lib/philox.glsl"
#include "lib/surface_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kCanonical = false;
layout(constant_id = 1) const bool kMasked = false;
layout(push_constant) uniform SampleSurfacePush {
    uint cells;
    uint samples; // of a voxel
    uint seed_low;
    uint seed_high;
} p;
layout(binding = 0) readonly buffer Triangles { uint triangles[]; };  // [T, 12]
layout(binding = 1) readonly buffer Attributes { uint attributes[]; }; // [T, 16]
layout(binding = 2) readonly buffer Materials { uint materials[]; };   // [M, 8]
layout(binding = 3) readonly buffer Textures { uint textures[]; };     // [textures, 4]
layout(binding = 4) readonly buffer Values { uint values[]; };         // [pairs]
layout(binding = 5) readonly buffer Sums { float sums[]; };            // [pairs]
layout(binding = 6) readonly buffer Starts { uint starts[]; };         // [keys + 1]
layout(binding = 7) readonly buffer Cells { ivec4 cells[]; };          // [voxels] i, j, k, key
layout(binding = 8) writeonly buffer Samples { float samples[]; };     // [voxels * samples, 8]
layout(binding = 9) writeonly buffer Addresses { uvec4 addresses[]; }; // [voxels * samples] of texels
layout(binding = 10) readonly buffer Alphas { uint alphas[]; };         // four bytes each

#include "lib/surface_alpha.glsl"

float unit(uint word) { return float(word >> 8) * (1.0 / 16777216.0); } // [0, 1)

// the first pair of the voxel whose sum exceeds a share of the whole, and how far into its area that is, 0..1; pairs
// without area are never that
uint pick_pair(uint key, float share, out float into)
{
    const uint first = starts[key];
    uint low = first, high = starts[key + 1] - 1;
    const float all = sums[high];
    // note: the product may round up to the whole, which no sum exceeds
    const float target = min(share * all, uintBitsToFloat(floatBitsToUint(all) - 1));
    while (low < high) {
        const uint middle = (low + high) / 2;
        if (sums[middle] > target)
            high = middle;
        else
            low = middle + 1;
    }
    const float before = low > first ? sums[low - 1] : 0.0;
    into = (target - before) / (sums[low] - before);
    return low;
}

const uint kMostPairs = 4096; // of a voxel that is looked at as a whole: one with more is no wall
const uint kAttempts = 32;    // to find a place with a surface
const float kFlat = 0.85;     // mean of |normal| along an axis from which on a surface faces it

#define CORNERS(t, origin, a, b, c)                                                                                    \
    const vec3 a = RECORD_CORNER(triangles, t, 0) - origin, b = RECORD_CORNER(triangles, t, 1) - origin,               \
               c = RECORD_CORNER(triangles, t, 2) - origin

// the axis that most of a voxel's surface faces, and to which side; false if it is bent
bool faced_axis(uint key, vec3 origin, out uint axis, out float side)
{
    vec3 along = vec3(0), signed_along = vec3(0);
    const uint first = starts[key], end = starts[key + 1];
    for (uint i = first; i < min(end, first + kMostPairs); ++i) {
        CORNERS(values[i], origin, a, b, c);
        const vec3 n = cross(b - a, c - a);
        const float size = length(n), area = sums[i] - (i > first ? sums[i - 1] : 0.0);
        if (!(size > 0.0))
            continue;
        along += abs(n) * (area / size);
        signed_along += n * (area / size);
    }
    axis = along.x >= along.y && along.x >= along.z ? 0 : along.y >= along.z ? 1 : 2;
    side = signed_along[axis] < 0.0 ? -1.0 : 1.0;
    return end - first <= kMostPairs && along[axis] >= kFlat * sums[end - 1];
}

// place k of n in rows over a square
vec2 place_in_rows(uint k, uint n)
{
    const uint rows = max(uint(sqrt(float(n)) + 0.5), 1u), row = k * rows / n;
    const uint first = (row * n + rows - 1) / rows, next = ((row + 1) * n + rows - 1) / rows;
    return vec2((float(row) + 0.5) / float(rows), (float(k - first) + 0.5) / float(next - first));
}

// the triangle of a voxel that is outermost at a place seen along an axis; false if there is none
bool outermost(uint key, vec3 origin, uint axis, float side, vec2 place, out uint found, out vec3 point)
{
    const uint u = (axis + 1) % 3, v = (axis + 2) % 3;
    float best = -3e38;
    for (uint i = starts[key]; i < starts[key + 1]; ++i) {
        CORNERS(values[i], origin, a, b, c);
        const vec2 p = place - vec2(a[u], a[v]), q = vec2(b[u], b[v]) - vec2(a[u], a[v]),
                   r = vec2(c[u], c[v]) - vec2(a[u], a[v]);
        const float area = q.x * r.y - q.y * r.x, wb = (p.x * r.y - p.y * r.x) / area,
                    wc = (q.x * p.y - q.y * p.x) / area;
        if (abs(area) < 1e-9 || min(min(wb, wc), 1.0 - wb - wc) < -1e-6)
            continue;
        const float height = a[axis] + wb * (b[axis] - a[axis]) + wc * (c[axis] - a[axis]);
        if (height < 0.0 || height >= 1.0 || height * side <= best)
            continue;
        if (kMasked && !has_surface(values[i], vec3(1.0 - wb - wc, wb, wc)))
            continue;
        best = height * side;
        found = values[i];
        point[u] = place.x;
        point[v] = place.y;
        point[axis] = height;
    }
    return best > -3e38;
}

// addresses of the four texels around a point of the texture, and where it lies between them
uvec4 texels_around(uint texture, vec2 uv, out vec2 between)
{
    const ivec2 size = ivec2(textures[4 * texture], textures[4 * texture + 1]);
    const uint wraps = textures[4 * texture + 3], u_mode = wraps & 3u, v_mode = wraps >> 2;
    const vec2 at = vec2(wrap_coordinate(uv.x, u_mode), wrap_coordinate(uv.y, v_mode)) * vec2(size) - 0.5;
    const ivec2 corner = ivec2(floor(at));
    between = at - vec2(corner);
    const uint x0 = wrap_texel(corner.x, size.x, u_mode), x1 = wrap_texel(corner.x + 1, size.x, u_mode);
    const uint y0 = wrap_texel(corner.y, size.y, v_mode) * uint(size.x);
    const uint y1 = wrap_texel(corner.y + 1, size.y, v_mode) * uint(size.x);
    return textures[4 * texture + 2] + uvec4(y0 + x0, y0 + x1, y1 + x0, y1 + x1);
}

// texels without a surface do not colour their neighbours: where colour and alpha are one texture
uvec4 opaque_texels(uvec4 around, uint t, vec3 weights, vec2 between)
{
    const uint m = RECORD_MATERIAL(triangles, t) * 8, color = materials[m + 3], alpha = materials[m + 5];
    if (!kMasked || materials[m + 7] == 0u)
        return around;
    const uint nearest = around[(between.y < 0.5 ? 0 : 2) + (between.x < 0.5 ? 0 : 1)];
    const float vertices = vertex_alpha(t, weights), threshold = material_threshold(t);
    for (uint i = 0; i < 4; ++i)
        if (vertices * alpha_at(around[i] - textures[4 * color + 2] + textures[4 * alpha + 2]) < threshold)
            around[i] = nearest;
    return around;
}

void write_color(uint to, uint t, vec3 weights)
{
    vec2 uv = vec2(0), between = vec2(0);
    vec3 color = vec3(0);
    for (uint corner = 0; corner < 3; ++corner) {
        uv += weights[corner] * CORNER_UV(attributes, t, corner);
        color += weights[corner] * CORNER_COLOR(attributes, t, corner);
    }
    const uint m = RECORD_MATERIAL(triangles, t) * 8, texture = materials[m + 3];
    uvec4 around = uvec4(kNoTexture);
    if (texture != kNoTexture)
        around = opaque_texels(texels_around(texture, uv, between), t, weights, between);
    addresses[to] = around;
    const vec3 factor = vec3(uintBitsToFloat(materials[m]), uintBitsToFloat(materials[m + 1]),
                             uintBitsToFloat(materials[m + 2])) * color;
    samples[8 * to + 3] = between.x;
    samples[8 * to + 4] = between.y;
    samples[8 * to + 5] = factor.x;
    samples[8 * to + 6] = factor.y;
    samples[8 * to + 7] = factor.z;
}

// by area: x is the share of it before the point, y how far the point lies from its fan's corner
void place_by_area(uint key, vec3 origin, float x, float y, out uint t, out vec3 point)
{
    float into;
    t = values[pick_pair(key, x, into)];
    CORNERS(t, origin, a, b, c);
    clip_to_cell(a, b, c);
    point = clamp(point_in_polygon(into, y), 0.0, 1.0);
}

// place_by_area() again with other numbers of the same share, until there is a surface
void place_on_surface(uint key, vec3 origin, uvec2 random, uint k, out uint t, out vec3 point)
{
    const uint share = 0xffffffffu / p.samples;
    for (uint attempt = 0; attempt < (kMasked ? kAttempts : 1); ++attempt) {
        place_by_area(key, origin, unit(random.x + k * share + attempt * 0xC13FA9A9u / p.samples),
                      unit(random.y + k * 0x9E3779B9u + attempt * 0x91E10DA5u), t, point);
        CORNERS(t, origin, a, b, c);
        if (!kMasked || has_surface(t, barycentric(point, a, b, c)))
            return;
    }
    CORNERS(t, origin, a, b, c);
    for (uint i = 0; i < kProbes; ++i) { // one of them is: the triangle has an area
        const vec3 place = clamp(probe((i + 37 * k) % kProbes), 0.0, 1.0);
        if (has_surface(t, barycentric(place, a, b, c))) {
            point = place;
            return;
        }
    }
}

void main()
{
    const uint to = linear_thread();
    if (to >= p.cells * p.samples)
        return;
    const ivec4 cell = cells[to / p.samples];
    const uint key = uint(cell.w), k = to % p.samples;
    const vec3 origin = vec3(cell_of_key(key));
    uint t, axis;
    float side;
    vec3 point;
    if (!kCanonical || !faced_axis(key, origin, axis, side) ||
        !outermost(key, origin, axis, side, place_in_rows(k, p.samples), t, point)) {
        const uvec4 random = kCanonical ? uvec4(0x80000000u / p.samples, 0x80000000u, 0, 0)
                                        : philox(uvec4(uvec3(cell.xyz), 0), uvec2(p.seed_low, p.seed_high));
        place_on_surface(key, origin, random.xy, k, t, point);
    }
    CORNERS(t, origin, a, b, c);
    samples[8 * to] = point.x - 0.5;
    samples[8 * to + 1] = point.y - 0.5;
    samples[8 * to + 2] = point.z - 0.5;
    write_color(to, t, barycentric(point, a, b, c));
}
