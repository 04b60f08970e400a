#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// marks the blocks within the truncation of every pixel's surface: points of the pixel's piece of plane, half a block
// apart, moved along the normal
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "lib/tsdf_frame.glsl"
#include "tsdf.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TsdfPush p; };
layout(binding = 0) readonly buffer Frames { float frame_words[]; }; // [frames, kFrameWords]
layout(binding = 1) readonly buffer Planes { uvec4 planes[]; };      // [rows]
layout(binding = 2) buffer Bitmap { uint bitmap[]; };                // bit per block of the box

const int kMostPieces = 12; // of a pixel that sees a surface at a grazing angle, each way

TsdfFrame f;

void mark(vec3 camera_point) // metres
{
    const vec3 v = camera_point * f.world_to_camera / p.voxel + f.rest; // times a rotation from the left: its inverse
    const ivec3 voxel = f.at + ivec3(floor(v));
    if (any(lessThan(voxel, ivec3(0))))
        return;
    const uvec3 b = uvec3(voxel) / 8;
    if (any(greaterThanEqual(b, uvec3(p.blocks_x, p.blocks_y, p.blocks_z))))
        return;
    const uint id = (b.z * p.blocks_y + b.y) * p.blocks_x + b.x;
    atomicOr(bitmap[id / 32], 1u << (id % 32));
}

// where a ray meets the plane, not beyond twice the pixel's own depth
vec3 hit(vec3 n, vec2 pixel, float z)
{
    const vec3 ray = vec3((pixel - f.center) / f.focal, 1);
    return ray / max(dot(n, ray), 0.5 / z);
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    const vec3 n = uintBitsToFloat(planes[i].xyz);
    uint row;
    FRAME_OF_PIXEL(frame_words, p.frames, i, row);
    if (n.z == 0.0 && n.x == 0.0 && n.y == 0.0 || row >= p.frames)
        return;
    LOAD_FRAME(frame_words, row, f);
    const vec2 at = vec2((i - f.first) % f.width, (i - f.first) / f.width);
    const vec3 own = vec3((at + 0.5 - f.center) / f.focal, 1);
    const float z = 1.0 / dot(n, own), step_length = 4.0 * p.voxel;
    const float wide = distance(hit(n, at + vec2(0, 0.5), z), hit(n, at + vec2(1, 0.5), z));
    const float high = distance(hit(n, at + vec2(0.5, 0), z), hit(n, at + vec2(0.5, 1), z));
    const int columns = clamp(int(ceil(wide / step_length)), 1, kMostPieces);
    const int rows = clamp(int(ceil(high / step_length)), 1, kMostPieces);
    const int layers = int(ceil(p.truncation / step_length));
    const vec3 normal = normalize(n);
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x) {
            const vec3 at_plane = hit(n, at + (vec2(x, y) + 0.5) / vec2(columns, rows), z);
            for (int layer = -layers; layer <= layers; ++layer)
                mark(at_plane + normal * (p.truncation * float(layer) / float(layers)));
        }
}
