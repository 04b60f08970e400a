// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what both variants of the blending share: a pixel's state, one splat over it, and the outputs
#include "lib/splat_record.glsl"

layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 1) readonly buffer Pairs { uint pairs[]; };      // [max_pairs] records by tile, nearest first
layout(binding = 2) readonly buffer Starts { uint starts[]; };    // [tiles + 1] first pair of each tile
layout(binding = 3) readonly buffer Sources { uint sources[]; };  // [max_visible] camera * splats + splat
layout(binding = 4) readonly buffer Labels { uint labels[]; };    // [splats]
layout(binding = 5) readonly buffer Cells { uint cells[]; };      // [splats]
layout(binding = 6) writeonly buffer Color { vec4 color[]; };     // [cameras, height, width] sum of w rgb; alpha
layout(binding = 7) writeonly buffer Surface { vec4 surface[]; }; // sum of w normal, camera frame; sum of w depth
layout(binding = 8) writeonly buffer Depth { vec2 depth[]; };     // expected, median
layout(binding = 9) writeonly buffer Ids { uvec2 ids[]; };        // label and cell of the largest w

const uint kNone = 0xffffffffu;

struct Pixel {
    float transmittance; // negative once the pixel is done
    vec3 color;
    vec3 normal;
    float depth;
    float median;
    float largest; // weight so far
    uint record;   // that had it
};

struct Splat {
    vec2 center;
    vec4 m;
    vec2 g;
    float z;
    float opacity;
    vec3 color;
    vec3 normal;
};

Pixel empty_pixel() { return Pixel(1.0, vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, kNone); }

Splat read_splat(vec4 t0, vec4 t1, vec4 t2, vec4 t3)
{
    return Splat(t0.xy, t1, t2.xy, t2.z, t2.w, t3.rgb, unpack_normal(floatBitsToUint(t3.w)));
}

// alpha = min(alpha_max, o exp(-r^2 / 2)), r the smaller of the distances on the surface, in sigmas, and on the screen;
// depth = that of the ray's hit, or of the centre where the screen is nearer
void blend(inout Pixel pixel, Splat s, vec2 at, uint record)
{
    const vec2 d = at - s.center;
    const float den = 1.0 + dot(s.g, d), scale = 1.0 / (abs(den) < 1e-20 ? 1e-20 : den);
    const vec2 uv = vec2(dot(s.m.xy, d), dot(s.m.zw, d)) * scale;
    const float r2_surface = dot(uv, uv), r2_screen = dot(d, d) * p.filter_scale;
    const bool hit = r2_surface <= r2_screen;
    const float r2 = hit ? r2_surface : r2_screen, z = hit ? s.z * scale : s.z;
    const float alpha = min(p.alpha_max, s.opacity * exp(-0.5 * r2)), t = pixel.transmittance;
    const bool seen = alpha >= p.alpha_min && z >= p.near && r2 <= p.cutoff2 && t > 0.0;
    const float next = t * (1.0 - alpha);
    const bool done = seen && next < p.transmittance_min, add = seen && !done;
    const float w = add ? alpha * t : 0.0, depth = add ? z : 0.0;
    pixel.color += w * s.color;
    pixel.normal += w * s.normal;
    pixel.depth += w * depth;
    pixel.median = add && t > 0.5 ? depth : pixel.median;
    pixel.record = w > pixel.largest ? record : pixel.record;
    pixel.largest = max(w, pixel.largest);
    pixel.transmittance = done ? -t : add ? next : t;
}

void store(Pixel pixel, uvec2 at, uint camera)
{
    if (at.x >= p.width || at.y >= p.height)
        return;
    const uint i = (camera * p.height + at.y) * p.width + at.x;
    const float alpha = 1.0 - abs(pixel.transmittance);
    color[i] = vec4(pixel.color, alpha);
    surface[i] = vec4(pixel.normal, pixel.depth);
    depth[i] = vec2(alpha > 0.0 ? pixel.depth / alpha : 0.0, pixel.median);
    const uint splat = pixel.record == kNone ? 0 : sources[pixel.record] % p.splats;
    ids[i] = pixel.record == kNone ? uvec2(kNone) : uvec2(labels[splat], cells[splat]);
}
