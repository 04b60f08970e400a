#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// where the surface of a pixel is in the next picture, and whether it is seen there (docs/method.md §5.5)
#extension GL_GOOGLE_include_directive : require
#include "lib/moving_pixel.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kModel = 0; // CameraModel
layout(constant_id = 1) const bool kMoving = false; // a camera moves while its picture is read out
layout(push_constant) uniform SplatFlowPush {
    uint width, height;
    uint mover_numbers;
    float tolerance; // of depth, relative
} p;
layout(binding = 0) readonly buffer Cameras { vec4 cameras[]; };  // [2, kCameraVectors] of this picture and the next
layout(binding = 1) readonly buffer Moves { vec4 move_rows[]; };  // [moves, 3] from this camera's frame to the next's
layout(binding = 2) readonly buffer Depth { vec2 depth[]; };      // [pixels] expected, median
layout(binding = 3) readonly buffer Owners { uint owners[]; };    // [pixels]
layout(binding = 4) readonly buffer NextDepth { vec2 next_depth[]; };
layout(binding = 5) readonly buffer MoverRows { uint mover_rows[]; }; // [mover_numbers]
layout(binding = 6) writeonly buffer Flow { vec2 flow[]; };       // [pixels] x, y, in pixels
layout(binding = 7) writeonly buffer States { uint states[]; };   // [pixels] FlowState of kernels/picture.h

#include "lib/splat_camera.glsl"
#include "lib/camera_pixel.glsl"
#include "lib/splat_mover.glsl"

const uint kNothing = 0, kSeen = 1, kHidden = 2, kOutside = 3;
const float kUnknown = 1e10; // as .flo has it

// the farthest of the four pixels around a position; nothing is farther than all
float farthest_around(vec2 at)
{
    const ivec2 corner = ivec2(floor(at - 0.5)), size = ivec2(p.width, p.height);
    float farthest = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 q = corner + ivec2(i & 1, i >> 1);
        q.x = kModel == kEquirectangular ? int(uint(q.x + size.x) % p.width) : clamp(q.x, 0, size.x - 1);
        q.y = clamp(q.y, 0, size.y - 1);
        const float d = next_depth[uint(q.y) * p.width + uint(q.x)].y;
        farthest = max(farthest, d > 0.0 ? d : 1e30);
    }
    return farthest;
}

uint follow(uint pixel, out vec2 to)
{
    const vec2 at = vec2(pixel % p.width, pixel / p.width) + 0.5;
    to = vec2(kUnknown);
    const float metres = depth[pixel].y;
    vec3 here;
    if (!(metres > 0.0) || !point_of(0, at, metres, here))
        return kNothing;
    const uint first = 3 * mover_of(owners[pixel], p.mover_numbers);
    const vec4 point = vec4(here, 1.0);
    const vec3 next = vec3(dot(move_rows[first], point), dot(move_rows[first + 1], point), dot(move_rows[first + 2], point));
    if (next == vec3(0.0)) // it is not there any more
        return kHidden;
    vec2 there;
    float away;
    if (!pixel_of(1, next, there, away) || !(away > 0.0))
        return kOutside;
    to = there - at;
    if (kModel == kEquirectangular) // the shorter way around
        to.x -= float(p.width) * floor(to.x / float(p.width) + 0.5);
    if (there.x < 0.0 || there.y < 0.0 || there.x >= float(p.width) || there.y >= float(p.height))
        return kOutside;
    return away > farthest_around(there) * (1.0 + p.tolerance) ? kHidden : kSeen;
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.width * p.height)
        return;
    vec2 to;
    states[i] = follow(i, to);
    flow[i] = to;
}
