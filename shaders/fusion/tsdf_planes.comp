#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the plane through every pixel's surface, N p = 1 in camera coordinates: inverse depth is linear in the pixel on a
// plane, w = w0 + a du + b dv, so N = (a fx, b fy, w0 - a (u0 - cx) - b (v0 - cy)). a and b are the smaller of the
// differences to both sides (minmod), 0 where they disagree in sign or a side has no depth. A pixel is an edge where a
// neighbour lies two voxels off its plane: the plane must not be trusted far from the pixel's centre.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "lib/tsdf_frame.glsl"
#include "tsdf.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TsdfPush p; };
layout(binding = 0) readonly buffer Frames { float frame_words[]; }; // [frames, kFrameWords]
layout(binding = 1) readonly buffer Pixels { uvec2 pixels[]; };      // [rows] depth, fp32; rgb, label << 24
layout(binding = 2) writeonly buffer Planes { uvec4 planes[]; };     // [rows] N, 0 for nothing; rgb, label << 24, edge << 31

const uint kNoLabel = 31;
const float kLeastCosine = 0.02; // between ray and normal: below it the slope is a jump from one surface to another

float inverse_depth(uint i)
{
    const float d = uintBitsToFloat(pixels[i].x);
    return d > 0.0 ? 1.0 / d : 0.0;
}

float slope(float before, float own, float after)
{
    const float b = own - before, a = after - own;
    return before == 0.0 || after == 0.0 || a * b <= 0.0 ? 0.0 : (abs(a) < abs(b) ? a : b);
}

bool off_plane(float predicted, float found)
{
    return found == 0.0 || predicted <= 0.0 || abs(1.0 / predicted - 1.0 / found) > 2.0 * p.voxel;
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    uint row;
    FRAME_OF_PIXEL(frame_words, p.frames, i, row);
    const float w = row < p.frames ? inverse_depth(i) : 0.0;
    if (w == 0.0 || 1.0 / w > p.max_depth) {
        planes[i] = uvec4(0);
        return;
    }
    TsdfFrame f;
    LOAD_FRAME(frame_words, row, f);
    const uint u = (i - f.first) % f.width, v = (i - f.first) / f.width;
    const vec2 at = vec2(u, v) + 0.5 - f.center;
    const bool inner_x = u > 0 && u + 1 < f.width, inner_y = v > 0 && v + 1 < f.height;
    const vec2 before = vec2(inner_x ? inverse_depth(i - 1) : 0.0, inner_y ? inverse_depth(i - f.width) : 0.0);
    const vec2 after = vec2(inner_x ? inverse_depth(i + 1) : 0.0, inner_y ? inverse_depth(i + f.width) : 0.0);
    vec2 s = vec2(slope(before.x, w, after.x), slope(before.y, w, after.y));
    vec3 n = vec3(s * f.focal, w - dot(s, at));
    const float cosine = w / (length(n) * length(vec3(at / f.focal, 1)));
    if (!(cosine >= kLeastCosine)) {
        s = vec2(0);
        n = vec3(0, 0, w);
    }
    const bool edge = off_plane(w - s.x, before.x) || off_plane(w + s.x, after.x) || off_plane(w - s.y, before.y) ||
                      off_plane(w + s.y, after.y);
    const uvec2 pixel = pixels[i];
    const uint label = min(pixel.y >> 24, kNoLabel);
    planes[i] = uvec4(floatBitsToUint(n), (pixel.y & 0xffffffu) | label << 24 | uint(edge) << 31);
}
