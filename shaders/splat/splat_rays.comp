#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// rays[camera][y][x] = unit ray through the centre of a pixel, and the depth of a hit at a distance of 1; a depth of 0
// where the lens does not look. Of a camera that moves, in its still frame (lib/moving_rays.glsl), and a second vector:
// turn of the readout, part
#extension GL_GOOGLE_include_directive : require
#include "splat.h"
#include "lib/lens.glsl"
#include "lib/moving_rays.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kModel = 1;
layout(constant_id = 1) const bool kMoving = false;
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; }; // [cameras, kCameraVectors]
layout(binding = 1) writeonly buffer Rays { vec4 rays[]; };      // [cameras, height, width], or twice as many
layout(binding = 2) readonly buffer Rows { vec4 rows[]; };       // [height] of a sweep: splat.h; else anything
#include "lib/splat_camera.glsl"

// of a sweep, and when it is fired; false where it is not one of the sweep's columns
bool firing(Lens l, uvec2 at, out vec3 ray, out float part)
{
    const vec4 row = rows[at.y];
    const float azimuth = (float(at.x) + 0.5 - l.focal.z) / l.focal.x + row.y, ring = accurate_cos(row.x);
    const float column = float(at.x) + l.first.x + row.z;
    ray = vec3(accurate_sin(azimuth) * ring, accurate_sin(row.x), accurate_cos(azimuth) * ring);
    part = (column + row.w) / l.first.y - 0.5;
    return column >= 0.0 && column < l.first.y;
}

void main()
{
    const uint i = linear_thread(), image = p.width * p.height;
    if (i >= p.cameras * image)
        return;
    const uint camera = i / image, at = i % image;
    const Lens lens = camera_lens(camera);
    vec3 ray = vec3(0.0);
    const vec2 position = vec2(at % p.width, at / p.width) + 0.5;
    const Motion motion = camera_motion(camera);
    float part = part_of(motion, position);
    bool seen = lens.focal.x != 0.0;
    if (kModel == kSpinning)
        seen = seen && firing(lens, uvec2(position), ray, part);
    else
        seen = seen && lens_unproject(kModel, lens, position, ray);
    const float depth = camera_depth_is_radial(camera) ? 1.0 : ray.z;
    if (!kMoving) {
        rays[i] = seen ? vec4(ray, depth) : vec4(0.0);
        return;
    }
    rays[2 * i] = seen ? vec4(turned(motion.turn, part, ray), depth) : vec4(0.0);
    rays[2 * i + 1] = vec4(motion.turn, part);
}
