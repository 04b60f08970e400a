#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// one thread a voxel, frames in order: with P the voxel's sample in camera coordinates and N the plane of the pixel
// that it projects to, d = (1 - N P) / |N|, D += w min(d / t, 1), W += w for d >= -band, where
// w = max(cosine, 0.1) / (1 + z), and behind the surface also times 1 + 0.9 d / band. Within the band the pixel that
// the nearest point of the surface projects to colours and votes, as often as pixels fit on the voxel's face:
// f^2 v^2 cosine / z^2, 1 to 16, so that who saw it well decides.
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "lib/tsdf_frame.glsl"
#include "tsdf.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TsdfPush p; };
layout(binding = 0) readonly buffer Frames { float frame_words[]; }; // [frames, kFrameWords]
layout(binding = 1) readonly buffer Planes { uvec4 planes[]; };      // [pixels]
layout(binding = 2) readonly buffer Blocks { uint blocks[]; };       // [rows / 512] ids in the box
layout(binding = 3) buffer State { float state[]; };                 // [blocks, kFields, 512] D, W, colour, its W, views
layout(binding = 4) buffer Votes { uint votes[]; };                  // [blocks, kVoteWords, 512] two counters a word

const uint kFields = 7, kVoteWords = 10, kClasses = 20;
const float kNear = 0.05; // metres

TsdfFrame f;

// the plane of the pixel that a point projects to, 0 for none
uvec4 plane_at(vec3 q)
{
    const vec2 uv = q.xy / q.z * f.focal + f.center;
    if (!(uv.x >= 0.0 && uv.y >= 0.0 && uv.x < float(f.width) && uv.y < float(f.height)))
        return uvec4(0);
    const uvec2 at = uvec2(uv);
    return planes[f.first + min(at.y, f.height - 1) * f.width + min(at.x, f.width - 1)];
}

// through the centre of the pixel that a point projects to
vec3 pixel_ray(vec3 q)
{
    return vec3((floor(q.xy / q.z * f.focal + f.center) + 0.5 - f.center) / f.focal, 1);
}

void vote(uint at, uint label, uint count)
{
    if (label >= kClasses)
        return;
    const uint word = at + label / 2 * 512, shift = label % 2 * 16;
    votes[word] += min(count, 0xffffu - (votes[word] >> shift & 0xffffu)) << shift;
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const uint block = i / 512, l = i % 512, id = blocks[block];
    const ivec3 voxel = 8 * ivec3(id % p.blocks_x, id / p.blocks_x % p.blocks_y, id / (p.blocks_x * p.blocks_y)) +
                        ivec3(l % 8, l / 8 % 8, l / 64);
    float sums[kFields];
    for (uint k = 0; k < kFields; ++k)
        sums[k] = state[(block * kFields + k) * 512 + l];
    for (uint row = 0; row < p.frames; ++row) {
        LOAD_FRAME(frame_words, row, f);
        const vec3 q = f.world_to_camera * ((vec3(voxel - f.at) + 0.5 - f.rest) * p.voxel);
        if (!(q.z > kNear && q.z <= p.max_depth + p.truncation))
            continue;
        uvec4 plane = plane_at(q);
        const vec3 n = uintBitsToFloat(plane.xyz), ray = q / q.z;
        const float along = dot(n, ray), scale = length(n); // along: inverse depth of the plane on this ray
        if (!(along > 0.0))
            continue;
        if (plane.w >> 31 != 0 && abs(1.0 / along - 1.0 / dot(n, pixel_ray(q))) > p.voxel)
            continue; // between an edge pixel's centre and the next surface
        const float d = (1.0 - dot(n, q)) / scale;
        if (!(d >= -p.band && q.z - 1.0 / along <= 2.0 * p.truncation))
            continue; // too far behind the surface: across it, or along the ray
        const float cosine = along / (scale * length(ray)), size = p.voxel * along;
        float w = max(cosine, 0.1) / (1.0 + 1.0 / along);
        if (d < 0.0)
            w *= 1.0 + 0.9 * d / p.band;
        sums[0] += w * min(d / p.truncation, 1.0);
        sums[1] += w;
        if (abs(d) > p.band)
            continue;
        const vec3 foot = q + n * (d / scale);
        const uvec4 other = foot.z > kNear ? plane_at(foot) : uvec4(0);
        const vec3 m = uintBitsToFloat(other.xyz);
        if (abs(1.0 - dot(m, foot)) <= 0.5 * p.voxel * length(m) && dot(m, foot) > 0.0)
            plane.w = other.w;
        sums[2] += w * float(plane.w & 0xffu);
        sums[3] += w * float(plane.w >> 8 & 0xffu);
        sums[4] += w * float(plane.w >> 16 & 0xffu);
        sums[5] += w;
        sums[6] += 1.0;
        const float pixels = f.focal.x * f.focal.y * size * size * cosine;
        vote(block * kVoteWords * 512 + l, plane.w >> 24 & 31, uint(clamp(ceil(pixels), 1.0, 16.0)));
    }
    for (uint k = 0; k < kFields; ++k)
        state[(block * kFields + k) * 512 + l] = sums[k];
}
