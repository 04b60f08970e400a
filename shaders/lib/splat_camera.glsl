// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// a row of the table of cameras with lenses: fx fy cx cy; world to camera [3, 4]; k1 k2 p1 p2 (fisheye: k1 k2 k3 k4);
// k3 k4 k5 k6; limit of the lens, 1 where depth is the distance from the camera instead of along z, 0, 0. A part of a
// sweep: fx is pixels a radian of azimuth, below 0 where it runs against the clock, fy 1, cy 0; in place of k1 k2 the column of
// pixel 0 and the columns of the sweep
const uint kCameraVectors = 7;

Lens camera_lens(uint camera)
{
    const uint at = camera * kCameraVectors;
    return Lens(cameras[at], cameras[at + 4], cameras[at + 5], cameras[at + 6].x);
}

mat4x3 camera_view(uint camera)
{
    const vec4 x = cameras[camera * kCameraVectors + 1], y = cameras[camera * kCameraVectors + 2], z = cameras[camera * kCameraVectors + 3];
    return mat4x3(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z, x.w, y.w, z.w);
}

bool camera_depth_is_radial(uint camera) { return cameras[camera * kCameraVectors + 6].y != 0.0; }
