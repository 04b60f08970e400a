// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Where a triangle has no surface because its alpha is too low. To be included after lib/clip_cell.glsl,
// lib/surface_record.glsl, the constant kMasked and the declaration of
//   attributes[], materials[], textures[]  as kernels/mesh.h has them
//   alphas[]                               uint, four bytes each

// the texel that holds a place of a texture
uint nearest_texel(uint texture, vec2 uv)
{
    const ivec2 size = ivec2(textures[4 * texture], textures[4 * texture + 1]);
    const uint wraps = textures[4 * texture + 3];
    const vec2 at = vec2(wrap_coordinate(uv.x, wraps & 3u), wrap_coordinate(uv.y, wraps >> 2)) * vec2(size);
    const uvec2 texel = uvec2(min(ivec2(at), size - 1));
    return textures[4 * texture + 2] + texel.y * uint(size.x) + texel.x;
}

float alpha_at(uint address) { return float(alphas[address >> 2] >> (8 * (address & 3u)) & 255u) * (1.0 / 255.0); }

float material_threshold(uint t) { return uintBitsToFloat(materials[RECORD_MATERIAL(triangles, t) * 8 + 6]); }

float vertex_alpha(uint t, vec3 weights)
{
    precise float alpha = weights.x * CORNER_ALPHA(attributes, t, 0) + weights.y * CORNER_ALPHA(attributes, t, 1) +
                          weights.z * CORNER_ALPHA(attributes, t, 2);
    return alpha;
}

bool has_surface(uint t, vec3 weights)
{
    const float threshold = material_threshold(t);
    if (!kMasked || !(threshold > 0.0))
        return true;
    const uint texture = materials[RECORD_MATERIAL(triangles, t) * 8 + 5];
    float alpha = vertex_alpha(t, weights);
    if (texture != kNoTexture) {
        precise vec2 uv = weights.x * CORNER_UV(attributes, t, 0) + weights.y * CORNER_UV(attributes, t, 1) +
                          weights.z * CORNER_UV(attributes, t, 2);
        alpha *= alpha_at(nearest_texel(texture, uv));
    }
    return alpha >= threshold;
}

// places spread over the clipped polygon, by which its share with a surface is measured
const uint kProbes = 64;
vec3 probe(uint i)
{
    return point_in_polygon((float(i) + 0.5) * (1.0 / float(kProbes)), fract(0.5 + float(i) * 0.61803399));
}
