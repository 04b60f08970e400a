#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// area[i] = area of a triangle within a voxel, in squares of the voxel's edge; label[i] = the triangle's, or where the
// texel that says it lies: the nearest to the middle of the clipped polygon
#extension GL_GOOGLE_include_directive : require
#include "lib/clip_cell.glsl"
#include "lib/surface_record.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kMasked = false; // materials have alpha: areas are those of what is a surface
layout(push_constant) uniform ClipAreaPush {
    uint size; // capacity of pairs
} p;
layout(binding = 0) readonly buffer Triangles { uint triangles[]; };      // [T, 12]
layout(binding = 1) readonly buffer Attributes { uint attributes[]; };     // [T, 16]
layout(binding = 2) readonly buffer Materials { uint materials[]; };       // [M, 8]
layout(binding = 3) readonly buffer Textures { uint textures[]; };         // [textures, 4]
layout(binding = 4) readonly buffer Count { uint count[]; };               // [1]
layout(binding = 5) readonly buffer Keys { uint keys[]; };                 // [size]
layout(binding = 6) readonly buffer Values { uint values[]; };             // [size]
layout(binding = 7) writeonly buffer Areas { float areas[]; };             // [size]
layout(binding = 8) writeonly buffer Labels { uint labels[]; };            // [size]
layout(binding = 9) writeonly buffer Addresses { uint label_address[]; }; // [size], 2^32 - 1: none
layout(binding = 10) readonly buffer Alphas { uint alphas[]; };            // four bytes each

#include "lib/surface_alpha.glsl"

uint address_of_label(uint t, vec3 a, vec3 b, vec3 c)
{
    const uint texture = materials[RECORD_MATERIAL(triangles, t) * 8 + 4];
    if (RECORD_LABEL(triangles, t) != kUnlabelled || texture == kNoTexture || polygon_size < 3)
        return kNoTexture;
    vec3 middle = vec3(0);
    for (uint i = 0; i < polygon_size; ++i)
        middle += polygon[i];
    const vec3 w = barycentric(middle / float(polygon_size), a, b, c);
    vec2 uv = vec2(0);
    for (uint corner = 0; corner < 3; ++corner)
        uv += w[corner] * CORNER_UV(attributes, t, corner);
    return nearest_texel(texture, uv);
}

// of the clipped polygon
float share_with_surface(uint t, vec3 a, vec3 b, vec3 c)
{
    if (!kMasked || !(material_threshold(t) > 0.0) || polygon_size < 3)
        return 1.0;
    uint found = 0;
    for (uint i = 0; i < kProbes; ++i)
        found += uint(has_surface(t, barycentric(clamp(probe(i), 0.0, 1.0), a, b, c)));
    return float(found) / float(kProbes);
}

void main()
{
    const uint i = linear_thread();
    if (i >= min(count[0], p.size))
        return;
    const uint t = values[i];
    const vec3 origin = vec3(cell_of_key(keys[i]));
    const vec3 a = RECORD_CORNER(triangles, t, 0) - origin, b = RECORD_CORNER(triangles, t, 1) - origin,
               c = RECORD_CORNER(triangles, t, 2) - origin;
    clip_to_cell(a, b, c);
    areas[i] = polygon_area() * share_with_surface(t, a, b, c);
    labels[i] = RECORD_LABEL(triangles, t);
    label_address[i] = address_of_label(t, a, b, c);
}
