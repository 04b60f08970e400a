#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what splats look like in files, one pixel a thread: bytes over a background, depths, labels, directions
#extension GL_GOOGLE_include_directive : require
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform SplatPixelsPush {
    uint pixels;
    float red, green, blue; // of the background, 0..255
    float visible_alpha;
    float depth_units; // to a metre, of 16 bits; 0: metres as fp32
} p;
layout(binding = 0) readonly buffer Color { vec4 color[]; };     // [pixels] sum of w rgb; alpha
layout(binding = 1) readonly buffer Surface { vec4 surface[]; }; // [pixels] sum of w normal; of w depth
layout(binding = 2) readonly buffer Depth { vec2 depth[]; };     // [pixels] expected, median
layout(binding = 3) readonly buffer Ids { uvec2 ids[]; };        // [pixels] label, voxel
layout(binding = 4) writeonly buffer Seen { uint seen[]; };      // [pixels] red, green, blue, visible or not
layout(binding = 5) writeonly buffer Depths { uint depths[]; };  // [pixels]
layout(binding = 6) writeonly buffer Normals { uint normals[]; }; // [pixels] x, y, z, label

uint color_byte(float value, float alpha, float background)
{
    precise float behind = (1.0 - alpha) * background;
    precise float v = value + divide(behind, 255.0);
    precise float scaled = clamp(v, 0.0, 1.0) * 255.0;
    return rounded(scaled);
}

uint direction_byte(float value, float length)
{
    precise float scaled = 127.0 * value;
    precise float v = 128.0 + (length > 0.0 ? divide(scaled, length) : 0.0);
    return rounded(v);
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.pixels)
        return;
    const vec4 c = color[i];
    seen[i] = color_byte(c.r, c.a, p.red) | color_byte(c.g, c.a, p.green) << 8 | color_byte(c.b, c.a, p.blue) << 16 |
              (c.a >= p.visible_alpha ? 255u << 24 : 0u);
    const float metres = depth[i].x;
    precise float units = metres * p.depth_units;
    // what 16 bits cannot hold is not measured: a reader would take the largest number for a wall
    const uint whole = units > 0.0 && units < 65534.5 ? rounded(units) : 0u;
    depths[i] = p.depth_units > 0.0 ? whole : metres > 0.0 ? floatBitsToUint(metres) : 0u;
    const vec3 n = surface[i].xyz;
    precise float square = n.x * n.x + n.y * n.y + n.z * n.z;
    const float length = square_root(square);
    normals[i] = direction_byte(n.x, length) | direction_byte(n.y, length) << 8 | direction_byte(n.z, length) << 16 |
                 min(ids[i].x, 255u) << 24;
}
