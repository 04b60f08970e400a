// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what both passes need of the camera, and of a cube; scene.c has the same
layout(push_constant) uniform Push {
    vec4 rows[3]; // world to camera
    vec4 lens;    // to clip space: scale of x and y, offset of x and y
    vec4 planes;  // near and far, metres; width of the picture, pixels
    vec4 cube;    // centre, half an edge
    vec4 color;
}
p;

// 0 at the near plane, 1 at the far one
float depth_of(float metres)
{
    const float near = p.planes.x, far = p.planes.y;
    return clamp(far / (far - near) * (1.0 - near / metres), 0.0, 1.0);
}
