#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// The picture: light from around is averaged over neighbours of like depth and direction, multiplied by the surface's
// colour and added to the straight light; then exposure, a shoulder and sRGB.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "shade.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { ShadePush p; };
layout(binding = 0) readonly buffer Light { vec4 light_in[]; };      // [pixels]
layout(binding = 1) readonly buffer Ambient { vec4 ambient_in[]; };  // [pixels]
layout(binding = 2) readonly buffer Surfaces { uvec4 surface_in[]; }; // [pixels]
layout(binding = 3) readonly buffer View { vec4 view[]; };           // [8]
layout(binding = 4) writeonly buffer Picture { uvec4 picture[]; };   // [pixels] sRGB; depth as bits; normal; label

#include "lib/view.glsl"

const int kReach = 3;

vec3 smoothed(ivec2 at, float depth, vec3 normal)
{
    vec4 sum = vec4(0.0);
    for (int dy = -kReach; dy <= kReach; ++dy)
        for (int dx = -kReach; dx <= kReach; ++dx) {
            const ivec2 q = at + ivec2(dx, dy);
            if (any(lessThan(q, ivec2(0))) || q.x >= int(p.width) || q.y >= int(p.height))
                continue;
            const uint j = uint(q.y) * p.width + uint(q.x);
            const float other = light_in[j].w;
            if (other <= 0.0)
                continue;
            const float alike = max(dot(unpackSnorm4x8(surface_in[j].y).xyz, normal), 0.0), alike2 = alike * alike;
            const float slack = 0.02 * depth + 0.006 * float(abs(dx) + abs(dy)) * depth + 0.02; // slopes are alike
            const float far = abs(other - depth) / slack + 0.08 * float(dx * dx + dy * dy);
            sum += vec4(ambient_in[j].rgb, 1.0) * (alike2 * alike2 * exp(-far));
        }
    return sum.w > 0.0 ? sum.rgb / sum.w : vec3(0.0);
}

// linear up to the shoulder, then slowly to 1
vec3 shoulder(vec3 c)
{
    const float knee = 0.62;
    const vec3 over = max(c - knee, 0.0);
    return min(c, knee) + (1.0 - knee) * (1.0 - exp(-over / (1.0 - knee)));
}

vec3 to_srgb(vec3 c)
{
    const vec3 curve = 1.055 * pow(max(c, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055;
    return mix(12.92 * c, curve, greaterThan(c, vec3(0.0031308)));
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const vec4 light = light_in[i], ambient = ambient_in[i];
    const uvec4 surface = surface_in[i];
    vec3 around = ambient.rgb;
    if (light.w > 0.0)
        around = smoothed(ivec2(i % p.width, i / p.width), light.w, unpackSnorm4x8(surface.y).xyz);
    vec3 albedo = unpackUnorm4x8(surface.x).rgb;
    albedo *= albedo;
    const vec3 c = to_srgb(shoulder((light.rgb + around * albedo * ambient.w) * exposure()));
    picture[i] = uvec4(packUnorm4x8(vec4(c, 1.0)), floatBitsToUint(light.w), surface.y, surface.z);
}
