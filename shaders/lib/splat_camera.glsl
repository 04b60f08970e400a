// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a row of the table of cameras with lenses: fx fy cx cy; world to camera [3, 4], in the middle of the readout; 12
// numbers of distortion (engine/camera/camera.h); limit of the lens, 1 where depth is the distance from the camera
// instead of along z, Motion::first, reach of the lens; Motion::turn, across.x; Motion::shift, across.y. A
// part of a sweep: fx is pixels a radian of azimuth, below 0 where it runs against the clock, fy 1, cy 0; of distortion
// the number of its first pixel, the columns of the sweep, and the least and the most that a row adds to a pixel's number
// for the column, and the delay, in which it is fired
const uint kCameraVectors = 10;

Lens camera_lens(uint camera)
{
    const uint at = camera * kCameraVectors;
    const vec4 ends = cameras[at + 7];
    return Lens(cameras[at], cameras[at + 4], cameras[at + 5], cameras[at + 6], ends.x, ends.w);
}

mat4x3 camera_view(uint camera)
{
    const vec4 x = cameras[camera * kCameraVectors + 1], y = cameras[camera * kCameraVectors + 2], z = cameras[camera * kCameraVectors + 3];
    return mat4x3(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z, x.w, y.w, z.w);
}

bool camera_depth_is_radial(uint camera) { return cameras[camera * kCameraVectors + 7].y != 0.0; }

Motion camera_motion(uint camera)
{
    const vec4 turn = cameras[camera * kCameraVectors + 8], shift = cameras[camera * kCameraVectors + 9];
    return Motion(turn.xyz, shift.xyz, vec2(turn.w, shift.w), cameras[camera * kCameraVectors + 7].z);
}
