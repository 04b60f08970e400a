// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what both variants of the blending of cameras with lenses share: one splat over one pixel, whose ray is known
// (docs/method.md §5.4)
#include "lib/splat_pixel.glsl"

layout(constant_id = 2) const uint kModel = 1;                 // CameraModel
layout(binding = 10) readonly buffer Rays { vec4 rays[]; };    // [cameras, height, width] unit ray, depth at 1

const uint kOpencv = 1, kEquirectangular = 3, kSpinning = 4;

struct RaySplat {
    vec2 center;
    vec3 a, b, normal;
    float plane; // normal . centre; 0: edge on, only the screen filter's dot remains
    float depth; // of the centre
    float opacity;
    vec3 color;
};

RaySplat read_splat(vec4 t0, vec4 t1, vec4 t2, vec4 t3, vec4 t4)
{
    return RaySplat(t0.xy, t1.xyz, t2.xyz, t3.xyz, t2.w, t3.w, t1.w, t4.rgb);
}

// no ray, no splats
vec4 pixel_ray(uvec2 at, uint camera)
{
    return at.x < p.width && at.y < p.height ? rays[(camera * p.height + at.y) * p.width + at.x] : vec4(0.0);
}
Pixel pixel_of_ray(vec4 ray)
{
    Pixel pixel = empty_pixel();
    pixel.transmittance = ray.w == 0.0 ? -1.0 : 1.0;
    return pixel;
}

// as for a pinhole (splat_blend.glsl), with the hit from the ray; nearness is along z for opencv, else the distance
void blend(inout Pixel pixel, RaySplat s, vec4 ray, vec2 at, uint record)
{
    vec2 d = at - s.center;
    if (kModel == kEquirectangular) // the shorter way around
        d.x -= float(p.width) * floor(d.x / float(p.width) + 0.5);
    const float den = dot(s.normal, ray.xyz), scale = 1.0 / (abs(den) < 1e-20 ? 1e-20 : den);
    const vec2 uv = vec2(dot(s.a, ray.xyz), dot(s.b, ray.xyz)) * scale;
    const float r2_surface = s.plane == 0.0 ? 1e30 : dot(uv, uv), r2_screen = dot(d, d) * p.filter_scale;
    const bool hit = kModel == kSpinning || r2_surface <= r2_screen; // a sweep has no screen filter
    const float r2 = hit ? r2_surface : r2_screen, distance = s.plane * scale;
    const float z = hit ? distance * ray.w : s.depth;
    const bool in_front = !hit || (kModel == kOpencv ? z : distance) >= p.near;
    const float alpha = min(p.alpha_max, s.opacity * exp(-0.5 * r2));
    const bool seen = alpha >= p.alpha_min && in_front && r2 <= p.cutoff2 && pixel.transmittance > 0.0;
    cover(pixel, s.color, s.normal, alpha, z, seen, record);
}
