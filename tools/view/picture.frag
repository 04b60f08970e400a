#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a pixel of the viewer's picture, of what the library has drawn
layout(push_constant) uniform Push // as in shading.cpp
{
    vec4 rows[3]; // world to camera
    vec4 lens;    // fx, fy, cx, cy
    uvec2 size;   // pixels
    uint shown;
    int brush; // voxels around the marked one, -1: none is marked
    ivec3 marked;
    float voxel; // metres
    float range; // metres, at which the depth picture has faded to a third
};
layout(binding = 0) readonly buffer Color { vec4 color[]; };
layout(binding = 1) readonly buffer Normal { vec4 normal[]; };
layout(binding = 2) readonly buffer Depth { vec2 depth[]; };
layout(binding = 3) readonly buffer Label { uvec2 label[]; };
layout(binding = 4) readonly buffer Refined { uint refined[]; };
layout(binding = 5) readonly buffer Palette { vec4 palette[]; };
layout(binding = 6) readonly buffer Instance { uint instance[]; };
layout(location = 0) out vec4 picture;

const uint kColor = 0, kDepth = 1, kNormal = 2, kLabels = 3, kCells = 4, kRefined = 5, kInstances = 6;
const vec3 kSky = vec3(0.62, 0.74, 0.86), kMark = vec3(1, 0.85, 0.1);

vec3 to_world(vec3 v)
{
    return v.x * rows[0].xyz + v.y * rows[1].xyz + v.z * rows[2].xyz;
}

vec3 place_of(float z)
{
    const vec3 at = vec3((gl_FragCoord.xy - lens.zw) / lens.xy, 1) * z;
    return to_world(at - vec3(rows[0].w, rows[1].w, rows[2].w));
}

// how near the pixel is to a border of its voxel, across the surface: a border that it lies along does not count
float border_of(vec3 place, vec3 facing)
{
    const vec3 inside = fract(place / voxel), away = min(inside, 1 - inside) * voxel;
    float least = 1;
    for (int axis = 0; axis < 3; ++axis)
        if (abs(facing[axis]) < 0.75)
            least = min(least, away[axis]);
    return least;
}

vec3 class_color(uint n)
{
    return label[n].x < palette.length() ? palette[label[n].x].rgb : kSky;
}

// neighbours in number are far apart in hue
vec3 instance_color(uint n)
{
    const float hue = fract(0.618034 * float(instance[n]));
    const vec3 c = clamp(abs(fract(hue + vec3(0, 2, 1) / 3) * 6 - 3) - 1, 0, 1);
    return instance[n] == 0 ? vec3(0.2) : mix(vec3(1), c, 0.7) * (0.6 + 0.4 * fract(0.381966 * float(instance[n])));
}

vec3 shade(uint n, vec3 place, vec3 facing)
{
    const bool seen = depth[n].y > 0;
    switch (shown) {
    case kDepth:
        return seen ? vec3(exp(-depth[n].y / range)) : vec3(0);
    case kNormal:
        return seen ? normalize(normal[n].xyz) * vec3(0.5, -0.5, -0.5) + 0.5 : vec3(0);
    case kLabels:
        return class_color(n);
    case kInstances:
        return instance_color(n);
    case kCells:
        const float border = smoothstep(0.01, 0.04, border_of(place, facing));
        return seen ? class_color(n) * mix(0.45, 0.7 + 0.3 * abs(facing.z), border) : kSky;
    }
    return color[n].rgb + (1 - color[n].a) * kSky;
}

void main()
{
    const uint n = uint(gl_FragCoord.y) * size.x + uint(gl_FragCoord.x);
    if (shown == kRefined) {
        picture = vec4(unpackUnorm4x8(refined[n]).rgb, 1);
        return;
    }
    const bool seen = depth[n].y > 0;
    const vec3 place = seen ? place_of(depth[n].y) : vec3(0);
    const vec3 facing = seen ? to_world(normalize(normal[n].xyz)) : vec3(0, 0, 1);
    picture = vec4(shade(n, place, facing), 1);
    const ivec3 away = abs(ivec3(floor(place / voxel)) - marked);
    if (seen && brush >= 0 && max(away.x, max(away.y, away.z)) <= brush)
        picture.rgb = mix(picture.rgb, kMark, border_of(place, facing) < 0.03 ? 0.9 : 0.35);
}
