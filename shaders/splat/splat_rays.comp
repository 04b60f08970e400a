#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// rays[camera][y][x] = unit ray through the centre of a pixel, and the depth of a hit at a distance of 1; a depth of 0
// where the lens does not look
#extension GL_GOOGLE_include_directive : require
#include "splat.h"
#include "lib/lens.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kModel = 1;
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; }; // [cameras, kCameraVectors]
layout(binding = 1) writeonly buffer Rays { vec4 rays[]; };      // [cameras, height, width]
layout(binding = 2) readonly buffer Rows { vec4 rows[]; };       // [height] of a sweep: splat.h; else anything
#include "lib/splat_camera.glsl"

// of a sweep; false where nothing is fired
bool firing(Lens l, uvec2 at, out vec3 ray)
{
    const vec4 row = rows[at.y];
    const float azimuth = (float(at.x) + 0.5 - l.focal.z) / l.focal.x + row.y;
    const float ring = accurate_cos(row.x);
    const int column = int(at.x) + int(l.first.x + row.z);
    ray = vec3(accurate_sin(azimuth) * ring, accurate_sin(row.x), accurate_cos(azimuth) * ring);
    return column >= 0 && column < int(l.first.y) && uint(column) % uint(row.w) == 0;
}

void main()
{
    const uint i = linear_thread(), image = p.width * p.height;
    if (i >= p.cameras * image)
        return;
    const uint camera = i / image, at = i % image;
    const Lens lens = camera_lens(camera);
    vec3 ray = vec3(0.0);
    const uvec2 pixel = uvec2(at % p.width, at / p.width);
    bool seen = lens.focal.x != 0.0;
    if (kModel == kSpinning)
        seen = seen && firing(lens, pixel, ray);
    else
        seen = seen && lens_unproject(kModel, lens, vec2(pixel) + 0.5, ray);
    rays[i] = seen ? vec4(ray, camera_depth_is_radial(camera) ? 1.0 : ray.z) : vec4(0.0);
}
