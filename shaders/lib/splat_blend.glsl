// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what both variants of the blending of pinhole cameras share: one splat over one pixel
#include "lib/splat_pixel.glsl"

layout(constant_id = 2) const bool kLimited = false;
layout(binding = 10) readonly buffer Limits { float limits[]; }; // [cameras, height, width] metres, if kLimited

// how far a pixel sees
float limit_of(uvec2 at, uint camera)
{
    if (!kLimited || at.x >= p.width || at.y >= p.height)
        return 1e30;
    return limits[(camera * p.height + at.y) * p.width + at.x];
}

struct Splat {
    vec2 center;
    vec4 m;
    vec2 g;
    float z;
    float opacity;
    vec3 color;
    vec3 normal;
};

Splat read_splat(vec4 t0, vec4 t1, vec4 t2, vec4 t3)
{
    return Splat(t0.xy, t1, t2.xy, t2.z, t2.w, t3.rgb, unpack_normal(floatBitsToUint(t3.w)));
}

// alpha = min(alpha_max, o exp(-r^2 / 2)), r the smaller of the distances on the surface, in sigmas, and on the screen;
// depth = that of the ray's hit, or of the centre where the screen is nearer
void blend(inout Pixel pixel, Splat s, vec2 at, uint record, float limit)
{
    const vec2 d = at - s.center;
    const float den = 1.0 + dot(s.g, d), scale = 1.0 / (abs(den) < 1e-20 ? 1e-20 : den);
    const vec2 uv = vec2(dot(s.m.xy, d), dot(s.m.zw, d)) * scale;
    const float r2_surface = dot(uv, uv), r2_screen = dot(d, d) * p.filter_scale;
    const bool hit = r2_surface <= r2_screen;
    const float z_surface = s.z * scale, z_screen = s.z, r2 = hit ? r2_surface : r2_screen, z = hit ? z_surface : z_screen;
    const float alpha = min(p.alpha_max, s.opacity * exp(-0.5 * r2));
    const bool within = z <= limit, open = pixel.transmittance > 0.0, bright = alpha >= p.alpha_min, ahead = z >= p.near;
    const bool near_enough = kLimited ? within : true, covered = r2 <= p.cutoff2;
    const bool seen = bright && ahead && covered && open && near_enough;
    cover(pixel, s.color, s.normal, alpha, z, seen, record);
}
