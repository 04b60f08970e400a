// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what both variants of the blending of cameras with lenses share: one splat over one pixel, whose ray is known
// (docs/method.md §5.4)
#include "lib/splat_pixel.glsl"

layout(constant_id = 2) const uint kModel = 1;                 // CameraModel
layout(constant_id = 8) const uint kTexels = kRayRecord;       // of a record
layout(binding = 10) readonly buffer Rays { vec4 rays[]; };    // [cameras, height, width] as splat_rays.comp makes them

#include "lib/trigonometry.glsl"
#include "lib/moving_rays.glsl"

const uint kOpencv = 1, kEquirectangular = 3, kSpinning = 5;
const bool kMoving = kTexels == kMovingRecord; // rays have origins of their own

struct RaySplat {
    vec2 center;
    vec3 a, b, normal; // moving: u axis / sigma_u, centre from the camera at part 0
    float plane; // normal . centre; 0: edge on, only the screen filter's dot remains. Moving: sigma_u / sigma_v
    float depth; // of the centre
    float opacity;
    vec3 color;
    vec3 drift; // moving: of the centre from the camera, a part
};

RaySplat read_splat(vec4 t0, vec4 t1, vec4 t2, vec4 t3, vec4 t4, vec4 t5)
{
    return RaySplat(t0.xy, t1.xyz, t2.xyz, t3.xyz, t2.w, t3.w, t1.w, t4.rgb, t5.xyz);
}

// a pixel's ray; part: of the readout
struct Ray {
    vec4 to; // unit, and the depth at a distance of 1
    float part;
    vec3 axis; // of the camera then, if kMoving
};

// no ray, no splats
Ray pixel_ray(uvec2 at, uint camera)
{
    if (at.x >= p.width || at.y >= p.height)
        return Ray(vec4(0.0), 0.0, vec3(0.0));
    const uint i = (camera * p.height + at.y) * p.width + at.x;
    if (kMoving) {
        const vec4 moved = rays[2 * i + 1];
        return Ray(rays[2 * i], moved.w, turned(moved.xyz, moved.w, vec3(0.0, 0.0, 1.0)));
    }
    return Ray(rays[i], 0.0, vec3(0.0));
}
Pixel pixel_of_ray(Ray ray)
{
    Pixel pixel = empty_pixel();
    pixel.transmittance = ray.to.w == 0.0 ? -1.0 : 1.0;
    return pixel;
}

// where a ray hits the plane of a splat
struct Hit {
    vec2 uv;        // in sigmas
    float distance; // from the camera
    bool edge_on;   // then there is none
    bool near;      // the splat is skipped
    vec3 normal;    // towards the camera
};

Hit hit_of(RaySplat s, Ray ray)
{
    const float den = dot(s.normal, ray.to.xyz), scale = 1.0 / (abs(den) < 1e-20 ? 1e-20 : den);
    if (!kMoving)
        return Hit(vec2(dot(s.a, ray.to.xyz), dot(s.b, ray.to.xyz)) * scale, s.plane * scale, s.plane == 0.0, false, s.normal);
    const vec3 center = s.b + ray.part * s.drift;
    const float plane = dot(s.normal, center), distance = plane * scale;
    const vec3 from_center = distance * ray.to.xyz - center;
    const vec2 uv = vec2(dot(s.a, from_center), s.plane * dot(cross(s.normal, s.a), from_center));
    const bool near = (kModel == kOpencv ? dot(ray.axis, center) : length(center)) <= p.near;
    return Hit(uv, distance, plane * plane <= 1e-10 * dot(center, center), near, plane > 0.0 ? -s.normal : s.normal);
}

// as for a pinhole (splat_blend.glsl), with the hit from the ray; nearness is along z for opencv, else the distance
void blend(inout Pixel pixel, RaySplat s, Ray ray, vec2 at, uint record)
{
    vec2 d = at - s.center;
    if (kModel == kEquirectangular) // the shorter way around
        d.x -= float(p.width) * floor(d.x / float(p.width) + 0.5);
    const Hit on = hit_of(s, ray);
    const float r2_surface = on.edge_on ? 1e30 : dot(on.uv, on.uv), r2_screen = dot(d, d) * p.filter_scale;
    const bool hit = kModel == kSpinning || r2_surface <= r2_screen; // a sweep has no screen filter
    const float r2 = hit ? r2_surface : r2_screen, z = hit ? on.distance * ray.to.w : s.depth;
    const bool in_front = !hit || (kModel == kOpencv ? z : on.distance) >= p.near;
    const float alpha = min(p.alpha_max, s.opacity * exp(-0.5 * r2));
    const bool seen = alpha >= p.alpha_min && in_front && !on.near && r2 <= p.cutoff2 && pixel.transmittance > 0.0;
    cover(pixel, s.color, on.normal, alpha, z, seen, record);
}

// normals are of the camera's own frame when the pixel is read
void store_ray(Pixel pixel, uvec2 at, uint camera)
{
    if (kMoving && at.x < p.width && at.y < p.height) {
        const vec4 moved = rays[2 * ((camera * p.height + at.y) * p.width + at.x) + 1];
        pixel.normal = turned(moved.xyz, -moved.w, pixel.normal);
    }
    store(pixel, at, camera);
}
