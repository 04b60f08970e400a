#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a cube without vertex buffers: six faces of two triangles, each face with a brightness
#extension GL_GOOGLE_include_directive : require
#include "view.glsl"

layout(location = 0) flat out vec4 color;

const uint kCorners[6] = uint[](0, 1, 2, 2, 1, 3);

void main()
{
    const uint face = gl_VertexIndex / 6, corner = kCorners[gl_VertexIndex % 6], axis = face % 3;
    vec3 at;
    at[axis] = face < 3 ? 1.0 : -1.0;
    at[(axis + 1) % 3] = float(corner & 1) * 2.0 - 1.0;
    at[(axis + 2) % 3] = float(corner >> 1) * 2.0 - 1.0;
    const vec4 world = vec4(p.cube.xyz + p.cube.w * at, 1.0);
    const vec3 camera = vec3(dot(p.rows[0], world), dot(p.rows[1], world), dot(p.rows[2], world));
    const float near = p.planes.x, far = p.planes.y;
    gl_Position = vec4(p.lens.xy * camera.xy + p.lens.zw * camera.z, far / (far - near) * (camera.z - near), camera.z);
    color = vec4(p.color.rgb * (axis == 2 ? 1.0 : axis == 0 ? 0.8 : 0.6), 1.0);
}
