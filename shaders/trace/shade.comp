#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// A pixel's light in two parts: what comes straight (sun with shadow, mirrored sky and street), and what the sky and
// the street around shine onto it, kept apart from the surface's colour so that shade_resolve can smooth it.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "shade.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { ShadePush p; };
layout(binding = 0) readonly buffer Nodes { uvec4 nodes[]; };          // [nodes, 4]
layout(binding = 1) readonly buffer Triangles { vec4 triangles[]; };   // [triangles, 3]
layout(binding = 2) readonly buffer Corners { uvec4 corners[]; };      // [triangles, 3]
layout(binding = 3) readonly buffer Materials { uvec4 materials[]; };  // [materials, 2]
layout(binding = 4) readonly buffer Texels { uint texels[]; };         // [texels]
layout(binding = 5) readonly buffer View { vec4 view[]; };             // [8]
layout(binding = 6) writeonly buffer Light { vec4 light_out[]; };      // [pixels] linear rgb; depth, 0: sky
layout(binding = 7) writeonly buffer Ambient { vec4 ambient_out[]; };  // [pixels] irradiance over pi; not sky, 0..1
layout(binding = 8) writeonly buffer Surfaces { uvec4 surface_out[]; }; // [pixels] root of albedo; normal; label; 0

#include "lib/bvh.glsl"
#include "lib/surface.glsl"
#include "lib/view.glsl"
#include "lib/sky.glsl"

const float kFar = 1e4, kLift = 2e-3; // metres; the lift keeps rays off the surface they leave

uint noise_state;
float next_noise() // PCG, O'Neill 2014
{
    noise_state = noise_state * 747796405u + 2891336453u;
    const uint word = ((noise_state >> ((noise_state >> 28) + 4)) ^ noise_state) * 277803737u;
    return float(((word >> 22) ^ word) >> 8) * (1.0 / 16777216.0);
}

void plane_axes(vec3 n, out vec3 x, out vec3 y)
{
    x = normalize(cross(abs(n.z) < 0.9 ? vec3(0, 0, 1) : vec3(1, 0, 0), n));
    y = cross(n, x);
}

// Rays of a sample: the pixel's own, one to the sun, some to all around, one mirrored. All go through one call of
// trace: four would be four copies of its loop, more registers than GPUs have.
const uint kPixelRay = 0, kSunRay = 1, kFirstAmbientRay = 2;

// to a point of the sun's disc; false where the surface turns away from it
bool sun_ray(vec3 point, Surface s, out Ray ray)
{
    if (dot(s.normal, sun_direction()) <= 0.0 || dot(s.facing, sun_direction()) <= 0.0)
        return false;
    vec3 x, y;
    plane_axes(sun_direction(), x, y);
    const float r = sun_width() * sqrt(next_noise()), turn = 6.2831853 * next_noise();
    const vec3 to_sun = normalize(sun_direction() + r * (cos(turn) * x + sin(turn) * y));
    ray = Ray(point + s.facing * kLift, to_sun, 0.0, kFar);
    return true;
}

// ray k of all around; directions are stratified over the samples of the pixel
bool ambient_ray(vec3 point, Surface s, uint k, float turn, out Ray ray)
{
    vec3 x, y;
    plane_axes(s.normal, x, y);
    const float r2 = (float(k) + next_noise()) / float(p.samples * p.ambient_rays);
    const float angle = 6.2831853 * (turn + float(k) * 0.61803399);
    const vec3 d = normalize(sqrt(r2) * (cos(angle) * x + sin(angle) * y) + sqrt(1.0 - r2) * s.normal);
    ray = Ray(point + s.facing * kLift, d, 0.0, kFar);
    return dot(d, s.facing) > 0.0;
}

bool mirror_ray(Ray seen, vec3 point, Surface s, out Ray ray)
{
    const vec3 d = reflect(seen.direction, s.normal);
    ray = Ray(point + s.facing * kLift, d, 0.0, kFar);
    return s.gloss > 0.03 && dot(d, s.facing) > 0.0;
}

// what comes back along a ray that is not followed further: the surface in an even light
vec3 even_light(Surface s)
{
    const float sunny = max(dot(s.normal, sun_direction()), 0.0) * 0.45;
    return s.albedo * (sun_light() * sunny * 0.318 + vec3(0.42, 0.44, 0.48) * sky_level() * (0.6 + 0.4 * s.normal.z));
}

float fresnel(Surface s, Ray ray) // Schlick's approximation
{
    const float facing = clamp(-dot(s.normal, ray.direction), 0.0, 1.0), away = 1.0 - facing;
    const float away2 = away * away;
    return s.gloss + (1.0 - s.gloss) * away2 * away2 * away;
}

struct Sum {
    vec3 light, ambient, albedo;
    float covered;
};

struct First { // what the pixel's middle shows
    float depth;
    uint normal, label;
};

// a sample: its light and what is around it are added to sum; the first tells what the pixel shows
void add_sample(inout Sum sum, inout First first, Ray seen, float far_at_depth_one, float spread, uint index,
                float turn)
{
    Surface s;
    vec3 point = vec3(0.0), light = vec3(0.0), ambient = vec3(0.0);
    float t = 0.0;
    const uint mirror = kFirstAmbientRay + p.ambient_rays;
    for (uint r = 0; r <= mirror; ++r) {
        Ray ray = seen;
        bool sent = true;
        if (r == kSunRay)
            sent = sun_ray(point, s, ray);
        else if (r == mirror)
            sent = mirror_ray(seen, point, s, ray);
        else if (r >= kFirstAmbientRay)
            sent = ambient_ray(point, s, index * p.ambient_rays + r - kFirstAmbientRay, turn, ray);
        if (!sent)
            continue;
        const Hit hit = trace(ray, r == kSunRay);
        const bool missed = hit.triangle == kNoTriangle;
        if (r == kSunRay) {
            if (missed)
                light = s.albedo * (sun_light() * dot(s.normal, sun_direction())) * 0.318309886;
            continue;
        }
        Surface found;
        if (!missed)
            found = surface_of(ray, hit, r == kPixelRay ? spread : r == mirror ? spread * 4.0 : 0.3);
        if (r == kPixelRay) {
            if (missed) {
                sum.light += sky_light(ray.direction);
                return;
            }
            s = found;
            t = hit.t;
            point = ray.origin + ray.direction * t;
        } else if (r == mirror) {
            light += 0.8 * fresnel(s, seen) * (missed ? sky_light(ray.direction) : even_light(found));
        } else {
            ambient += missed ? clear_sky(ray.direction) : even_light(found);
        }
    }
    const float clear = exp(-t / haze_distance());
    const vec3 haze = clear_sky(normalize(vec3(seen.direction.xy, 0.03))) * 0.9;
    sum.light += mix(haze, light, clear);
    sum.ambient += ambient / float(p.ambient_rays);
    sum.albedo += s.albedo * clear;
    sum.covered += 1.0;
    if (index == 0) {
        const vec3 n = vec3(dot(s.normal, view_axis(0)), dot(s.normal, view_axis(1)), dot(s.normal, view_axis(2)));
        first = First(t / far_at_depth_one, packSnorm4x8(vec4(n, 0.0)), s.label);
    }
}

void main()
{
    const uint at = linear_thread();
    if (at >= p.rows)
        return;
    const uint pixel = p.first_row + at, x = pixel % p.width, y = pixel / p.width;
    noise_state = pixel * 9781u + p.seed * 6271u;
    next_noise();
    const float turn = float((x & 3u) * 4u + (y & 3u)) / 16.0 + 0.31 * float((x ^ y) & 1u); // differs among neighbours
    const float spread = 1.0 / view[0].x * inversesqrt(float(p.samples));
    Sum sum = Sum(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    First first = First(0.0, 0, 10); // nothing: label sky
    for (uint i = 0; i < p.samples; ++i) {
        // the first sample through the centre, the others on a lattice of rank 1 about it
        const vec2 shift = i == 0 ? vec2(0.5) : fract(vec2(0.5) + float(i) * vec2(0.7548777, 0.5698403));
        const vec3 along = pixel_direction(vec2(x, y) + shift);
        add_sample(sum, first, Ray(view_origin(), normalize(along), 0.05, kFar), length(along), spread, i, turn);
    }
    const float all = 1.0 / float(p.samples), some = 1.0 / max(sum.covered, 1.0);
    light_out[at] = vec4(sum.light * all, first.depth);
    ambient_out[at] = vec4(sum.ambient * some, sum.covered * all);
    surface_out[at] = uvec4(packUnorm4x8(vec4(sqrt(sum.albedo * some), 0.0)), first.normal, first.label, 0);
}
