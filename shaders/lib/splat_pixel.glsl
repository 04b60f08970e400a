// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// what all blending shares: a pixel's state, what a splat adds to it, and the outputs
#include "lib/splat_record.glsl"

layout(constant_id = 3) const bool kColor = true; // made, and so on
layout(constant_id = 4) const bool kSurface = true;
layout(constant_id = 5) const bool kDepth = true;
layout(constant_id = 6) const bool kIds = true;
layout(constant_id = 7) const bool kOwners = true;
layout(constant_id = 9) const bool kMedianIds = false; // ids and owners are those of the median depth's splat
layout(push_constant) uniform Push { SplatPush p; };
layout(binding = 1) readonly buffer Pairs { uint pairs[]; };      // [max_pairs] records by tile, nearest first
layout(binding = 2) readonly buffer Starts { uint starts[]; };    // [tiles + 1] first pair of each tile
layout(binding = 3) readonly buffer Sources { uint sources[]; };  // [max_visible] camera * splats + splat
layout(binding = 4) readonly buffer Labels { uint labels[]; };    // [splats]
layout(binding = 5) readonly buffer Cells { uint cells[]; };      // [splats]
layout(binding = 6) writeonly buffer Color { vec4 color[]; };     // [cameras, height, width] sum of w rgb; alpha
layout(binding = 7) writeonly buffer Surface { vec4 surface[]; }; // sum of w normal, camera frame; sum of w depth
layout(binding = 8) writeonly buffer Depth { vec2 depth[]; };     // expected, median
layout(binding = 9) writeonly buffer Ids { uvec2 ids[]; };        // label and voxel of the largest w
layout(binding = 11) readonly buffer Owners { uint owners[]; };   // [splats]
layout(binding = 12) writeonly buffer Owner { uint owner[]; };    // of the largest w

const uint kNone = 0xffffffffu;

struct Pixel {
    float transmittance; // negative once the pixel is done
    vec3 color;
    vec3 normal;
    float depth;
    float median;
    float largest; // weight so far
    uint record;   // that had it, or the median
};

Pixel empty_pixel() { return Pixel(1.0, vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, kNone); }

// a splat's colour, seen normal and depth over a pixel. Choices are between names: trigonometry.glsl says why
void cover(inout Pixel pixel, vec3 color, vec3 normal, float alpha, float z, bool seen, uint record)
{
    const float t = pixel.transmittance, next = t * (1.0 - alpha), given = alpha * t;
    const bool last = next < p.transmittance_min, done = seen && last, add = seen && !last;
    const float w = add ? given : 0.0, depth = add ? z : 0.0;
    pixel.color += w * color;
    pixel.normal += w * normal;
    pixel.depth += w * depth;
    const bool front = t > 0.5, median = add && front, largest = w > pixel.largest;
    const bool taken = kMedianIds ? median : largest;
    const float median_depth = pixel.median, end = -t, left = add ? next : t;
    const uint before = pixel.record;
    pixel.median = median ? depth : median_depth;
    pixel.record = taken ? record : before;
    pixel.largest = max(w, pixel.largest);
    pixel.transmittance = done ? end : left;
}

void store(Pixel pixel, uvec2 at, uint camera)
{
    if (at.x >= p.width || at.y >= p.height)
        return;
    const uint i = (camera * p.height + at.y) * p.width + at.x;
    const float alpha = 1.0 - abs(pixel.transmittance);
    if (kColor)
        color[i] = vec4(pixel.color, alpha);
    if (kSurface)
        surface[i] = vec4(pixel.normal, pixel.depth);
    if (kDepth)
        depth[i] = vec2(alpha > 0.0 ? pixel.depth / alpha : 0.0, pixel.median);
    if (!kIds && !kOwners)
        return;
    const bool none = pixel.record == kNone;
    const uint splat = none ? 0 : sources[pixel.record] % p.splats;
    if (kIds)
        ids[i] = none ? uvec2(kNone) : uvec2(labels[splat], cells[splat]);
    if (kOwners)
        owner[i] = none ? 0 : owners[splat];
}
