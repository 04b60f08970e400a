#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = the ray through a pixel, whether the lens looks there; the pixel of that ray
#extension GL_GOOGLE_include_directive : require
#include "lib/lens.glsl"
#include "lib/moving_rays.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kModel = 1;
layout(push_constant) uniform LensTripPush {
    uint count;
} p;
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; }; // [1, kCameraVectors]
layout(binding = 1) readonly buffer Pixels { vec2 pixels[]; };   // [count]
layout(binding = 2) writeonly buffer Y { vec4 y[]; };            // [count, 2]
#include "lib/splat_camera.glsl"

void main()
{
    const uint i = linear_thread();
    if (i >= p.count)
        return;
    const Lens lens = camera_lens(0);
    vec3 ray;
    vec2 pixel = vec2(0.0);
    bool seen = lens_unproject(kModel, lens, pixels[i], ray);
    seen = seen && lens_project(kModel, lens, 5.0 * ray, pixel);
    y[2 * i] = vec4(ray, seen ? 1.0 : 0.0);
    y[2 * i + 1] = vec4(pixel, 0.0, 0.0);
}
