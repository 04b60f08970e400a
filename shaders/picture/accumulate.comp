#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a frame and the one before it where both see the same surface, four pixels a thread (docs/method.md §6.5)
#extension GL_GOOGLE_include_directive : require
#include "lib/moving_pixel.glsl"
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kModel = 0; // CameraModel
layout(constant_id = 1) const bool kMoving = false; // a camera moves while its picture is read out
layout(push_constant) uniform AccumulatePush {
    uint width, height;
    uint words;      // of a picture
    float share;     // of the frame before
    float tolerance; // of depth, relative
    float spread;    // standard deviations around the mean that the frame before is cut to
} p;
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; };       // [2, kCameraVectors] of the frame and the one before
layout(binding = 1) readonly buffer Now { uint now[]; };               // [words] bytes
layout(binding = 2) readonly buffer Past { uint past[]; };             // [words] bytes
layout(binding = 3) readonly buffer DepthNow { float depth_now[]; };   // [pixels] metres; 0: nothing
layout(binding = 4) readonly buffer DepthPast { float depth_past[]; }; // [pixels]
layout(binding = 5) writeonly buffer Result { uint result[]; };        // [words] bytes

#include "lib/splat_camera.glsl"
#include "lib/camera_pixel.glsl"

const float kInfinity = 1e7; // metres

float metres(float depth) { return depth > 0.0 ? depth : kInfinity; }

// columns go on around a panorama, of which they leave two at most
ivec2 inside(ivec2 at)
{
    const int width = int(p.width);
    const int x = kModel == kEquirectangular ? int(uint(at.x + 2 * width) % p.width) : clamp(at.x, 0, width - 1);
    return ivec2(x, clamp(at.y, 0, int(p.height) - 1));
}

uint index_of(ivec2 at)
{
    const ivec2 pixel = inside(at);
    return uint(pixel.y) * p.width + uint(pixel.x);
}

// three bytes of two words, from `byte` of the first one on
vec3 color_of(uint first, uint second, uint byte)
{
    const uint bits = byte == 0 ? first : first >> 8 * byte | second << (32 - 8 * byte);
    return vec3(bits & 255u, bits >> 8 & 255u, bits >> 16 & 255u);
}

vec3 color_now(ivec2 at)
{
    const uint byte = 3 * index_of(at), word = byte / 4;
    return color_of(now[word], now[min(word + 1, p.words - 1)], byte % 4);
}

vec3 color_past(ivec2 at)
{
    const uint byte = 3 * index_of(at), word = byte / 4;
    return color_of(past[word], past[min(word + 1, p.words - 1)], byte % 4);
}

// where the frame before saw what this pixel shows; its depth there
bool find_source(ivec2 pixel, out vec2 source, out float depth)
{
    vec3 point;
    return point_of(0, vec2(pixel) + 0.5, metres(depth_now[index_of(pixel)]), point) &&
           pixel_of(1, camera_view(1) * vec4(point, 1.0), source, depth) && depth > 0.0 && source.x >= 0.0 &&
           source.y >= 0.0 && source.x < float(p.width) && source.y < float(p.height);
}

// the four pixels around it have the depth between them
bool is_same_surface(vec2 source, float depth)
{
    const ivec2 corner = ivec2(floor(source - 0.5));
    float nearest = 2.0 * kInfinity, farthest = 0.0;
    for (int i = 0; i < 4; ++i) {
        const float d = metres(depth_past[index_of(corner + ivec2(i & 1, i >> 1))]);
        nearest = min(nearest, d);
        farthest = max(farthest, d);
    }
    return depth >= nearest * (1.0 - p.tolerance) && depth <= farthest * (1.0 + p.tolerance);
}

vec4 catmull_rom(float t)
{
    const float t2 = t * t, t3 = t2 * t;
    return vec4(-0.5 * t + t2 - 0.5 * t3, 1.0 - 2.5 * t2 + 1.5 * t3, 0.5 * t + 2.0 * t2 - 1.5 * t3, 0.5 * (t3 - t2));
}

vec3 sample_past(vec2 source)
{
    const vec2 at = source - 0.5, corner = floor(at);
    const vec4 across = catmull_rom(at.x - corner.x), down = catmull_rom(at.y - corner.y);
    vec3 sum = vec3(0.0);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x)
            sum += across[x] * down[y] * color_past(ivec2(corner) + ivec2(x - 1, y - 1));
    return sum;
}

// to what the frame has around the pixel: what is not like it is of another surface, or of another light
vec3 clip_to_neighbours(vec3 color, ivec2 pixel)
{
    vec3 sum = vec3(0.0), squares = vec3(0.0);
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            const vec3 c = color_now(pixel + ivec2(x, y));
            sum += c;
            squares += c * c;
        }
    const vec3 mean = sum / 9.0, reach = p.spread * sqrt(max(squares / 9.0 - mean * mean, vec3(0.0)));
    return clamp(color, mean - reach, mean + reach);
}

uvec3 accumulated(ivec2 pixel)
{
    const vec3 color = color_now(pixel);
    vec2 source;
    float depth;
    if (!find_source(pixel, source, depth) || !is_same_surface(source, depth))
        return uvec3(color);
    const vec3 mixed = mix(color, clip_to_neighbours(sample_past(source), pixel), p.share);
    return uvec3(clamp(mixed, 0.0, 255.0) + 0.5);
}

void main()
{
    const uint i = linear_thread();
    uint bytes[12];
    for (uint k = 0; k < 4; ++k) {
        const uint pixel = 4 * i + k;
        const uvec3 color =
            pixel < p.width * p.height ? accumulated(ivec2(pixel % p.width, pixel / p.width)) : uvec3(0);
        for (uint c = 0; c < 3; ++c)
            bytes[3 * k + c] = color[c];
    }
    for (uint w = 0; w < 3; ++w)
        if (3 * i + w < p.words)
            result[3 * i + w] =
                bytes[4 * w] | bytes[4 * w + 1] << 8 | bytes[4 * w + 2] << 16 | bytes[4 * w + 3] << 24;
}
