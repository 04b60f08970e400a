#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what sr_world_record drew, over a sky, into picture and z-buffer: what is drawn after it stands among the splats
#extension GL_GOOGLE_include_directive : require
#include "view.glsl"

layout(binding = 0) readonly buffer Colors { vec4 colors[]; }; // r, g, b times alpha, alpha
layout(binding = 1) readonly buffer Depths { vec2 depths[]; }; // metres: mean, median
layout(location = 0) out vec4 color;

void main()
{
    const uint i = uint(gl_FragCoord.y) * uint(p.planes.z) + uint(gl_FragCoord.x);
    const vec4 seen = colors[i];
    color = vec4(seen.rgb + (1.0 - seen.a) * p.color.rgb, 1.0);
    gl_FragDepth = seen.a < 0.5 ? 1.0 : depth_of(depths[i].y); // more hole than splat is sky
}
