// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// What a hit is made of. To be included after lib/bvh.glsl and the declaration of
//   corners[]   uvec4, three a triangle: u, v of the corners as floats (six); packed normals (three); texture
//               coordinates a metre (float); 0, 0
//   materials[] uvec4, two a material: linear r, g, b, gloss as floats; first texel, width, height, levels (0: none)
//   texels[]    uint, sRGB and no alpha; the levels of a picture one after the other
struct Surface {
    vec3 albedo; // linear
    vec3 normal; // towards where the ray came from
    vec3 facing; // likewise, of the flat triangle
    float gloss;
    uint label;
};

vec3 from_srgb(vec3 c) { return c * (c * (c * 0.305306011 + 0.682171111) + 0.012522878); } // to 0.001

// at: from -size on
vec3 texel(uint first, ivec2 size, ivec2 at)
{
    at = ivec2(uvec2(at + size) % uvec2(size));
    return from_srgb(unpackUnorm4x8(texels[first + uint(at.y * size.x + at.x)]).rgb);
}

vec3 bilinear(uint first, ivec2 size, vec2 uv)
{
    const vec2 at = fract(uv) * vec2(size) - 0.5, f = fract(at);
    const ivec2 low = ivec2(floor(at));
    return mix(mix(texel(first, size, low), texel(first, size, low + ivec2(1, 0)), f.x),
               mix(texel(first, size, low + ivec2(0, 1)), texel(first, size, low + ivec2(1, 1)), f.x), f.y);
}

// footprint: of the pixel, in pictures
vec3 textured(uvec4 picture, vec2 uv, float footprint)
{
    const float level = clamp(log2(max(footprint * float(max(picture.y, picture.z)), 1e-6)), 0.0, float(picture.w - 1));
    const uint low = uint(level);
    uint first = picture.x;
    ivec2 size = ivec2(picture.yz);
    for (uint l = 0; l < low; ++l) {
        first += uint(size.x * size.y);
        size = max(size / 2, ivec2(1));
    }
    const vec3 fine = bilinear(first, size, uv);
    if (low + 1 >= picture.w || level - float(low) < 0.02)
        return fine;
    return mix(fine, bilinear(first + uint(size.x * size.y), max(size / 2, ivec2(1)), uv), level - float(low));
}

// octahedral, 16 bits a coordinate: Cigolle et al., "A survey of efficient representations for unit vectors", 2014
vec3 unpack_normal(uint bits)
{
    const vec2 p = unpackSnorm2x16(bits);
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    const float below = max(-n.z, 0.0);
    n.xy += mix(vec2(below), vec2(-below), greaterThanEqual(n.xy, vec2(0.0)));
    return normalize(n);
}

// spread: of the pixel's cone, a tangent
Surface surface_of(Ray ray, Hit hit, float spread)
{
    const uint t = hit.triangle;
    const vec4 a = triangles[3 * t], e1 = triangles[3 * t + 1], e2 = triangles[3 * t + 2];
    const uvec4 c0 = corners[3 * t], c1 = corners[3 * t + 1], c2 = corners[3 * t + 2];
    const float w = 1.0 - hit.u - hit.v;
    const vec2 uv = w * uintBitsToFloat(c0.xy) + hit.u * uintBitsToFloat(c0.zw) + hit.v * uintBitsToFloat(c1.xy);
    const uint material = floatBitsToUint(e1.w);
    const uvec4 color = materials[2 * material], picture = materials[2 * material + 1];
    Surface s;
    s.facing = normalize(cross(e1.xyz, e2.xyz));
    s.normal = normalize(w * unpack_normal(c1.z) + hit.u * unpack_normal(c1.w) + hit.v * unpack_normal(c2.x));
    const float side = dot(s.facing, ray.direction) > 0.0 ? -1.0 : 1.0;
    s.facing *= side;
    s.normal *= side;
    const float along = -dot(s.facing, normalize(ray.direction));
    const float footprint = spread * hit.t * uintBitsToFloat(c2.y) * inversesqrt(max(along, 0.02));
    s.albedo = uintBitsToFloat(color.rgb);
    if (picture.w > 0)
        s.albedo *= textured(picture, uv, footprint);
    s.gloss = uintBitsToFloat(color.w);
    s.label = floatBitsToUint(e2.w);
    return s;
}
