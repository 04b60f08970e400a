// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// pixels with a depth and points of a camera's own (still) frame, both ways; of cameras in a table (splat_camera.glsl).
// Needs kModel and kMoving.

float camera_depth(uint camera, vec3 point)
{
    return camera_depth_is_radial(camera) ? length(point) : point.z;
}

// false: the lens does not look there
bool point_of(uint camera, vec2 position, float metres, out vec3 point)
{
    vec3 ray;
    if (!lens_unproject(kModel, camera_lens(camera), position, ray) || !(camera_depth(camera, ray) > 0.0))
        return false;
    point = ray * (metres / camera_depth(camera, ray));
    if (kMoving) {
        const Motion motion = camera_motion(camera);
        const float part = part_of(motion, position);
        point = turned(motion.turn, part, point) + part * motion.shift;
    }
    return true;
}

// false: no line of the picture sees it
bool pixel_of(uint camera, vec3 point, out vec2 position, out float depth)
{
    const Lens lens = camera_lens(camera);
    if (!kMoving) {
        depth = camera_depth(camera, point);
        return lens_project(kModel, lens, point, position);
    }
    const Motion motion = camera_motion(camera);
    const float guesses[3] = {0.0, -0.5, 0.5};
    for (uint i = 0; i < 3; ++i) {
        float part = guesses[i];
        if (!settle(kModel, lens, motion, point, -0.5, 0.5, part, position))
            continue;
        depth = camera_depth(camera, seen_at(motion, part, point));
        return true;
    }
    return false;
}
