// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// What kernels/mesh.h says of SurfaceTriangles, taken apart.

const uint kRecord = 12;     // words of a triangle
const uint kAttributes = 16; // and of its corners' attributes
const uint kBlockEdge = 8;   // voxels
const uint kBlockCells = 512;
const uint kPlaceBits = 9; // of a triangle's place within a voxel, 8 along each axis
const uint kNoTexture = 0xffffffffu;
const uint kUnlabelled = 20; // one behind the last class

ivec3 cell_of_key(uint key)
{
    const uint cell = key % kBlockCells;
    return ivec3(cell / (kBlockEdge * kBlockEdge), cell / kBlockEdge % kBlockEdge, cell % kBlockEdge);
}

#define RECORD_CORNER(triangles, t, corner)                                                                            \
    vec3(uintBitsToFloat(triangles[(t) * kRecord + 3 * (corner)]),                                                     \
         uintBitsToFloat(triangles[(t) * kRecord + 3 * (corner) + 1]),                                                 \
         uintBitsToFloat(triangles[(t) * kRecord + 3 * (corner) + 2]))
#define RECORD_SLOT(triangles, t) triangles[(t) * kRecord + 9]
#define RECORD_RANGE(triangles, t) triangles[(t) * kRecord + 10]
#define RECORD_MATERIAL(triangles, t) (triangles[(t) * kRecord + 11] & 0xffffffu)
#define RECORD_LABEL(triangles, t) (triangles[(t) * kRecord + 11] >> 24)
#define CORNER_UV(attributes, t, corner)                                                                               \
    vec2(uintBitsToFloat(attributes[(t) * kAttributes + 2 * (corner)]),                                                \
         uintBitsToFloat(attributes[(t) * kAttributes + 2 * (corner) + 1]))
#define CORNER_COLOR(attributes, t, corner)                                                                            \
    vec3(uintBitsToFloat(attributes[(t) * kAttributes + 6 + 3 * (corner)]),                                            \
         uintBitsToFloat(attributes[(t) * kAttributes + 7 + 3 * (corner)]),                                            \
         uintBitsToFloat(attributes[(t) * kAttributes + 8 + 3 * (corner)]))

#define CORNER_ALPHA(attributes, t, corner)                                                                             \
    (float(attributes[(t) * kAttributes + 15] >> (8 * (corner)) & 255u) * (1.0 / 255.0))

// weights of the corners for a point of the triangle; the centre's for one without area
vec3 barycentric(vec3 point, vec3 a, vec3 b, vec3 c)
{
    const vec3 u = b - a, v = c - a, w = point - a, n = cross(u, v);
    const float square = dot(n, n);
    if (!(square > 0.0))
        return vec3(1.0 / 3.0);
    const float wb = clamp(dot(cross(w, v), n) / square, 0.0, 1.0);
    const float wc = clamp(dot(cross(u, w), n) / square, 0.0, 1.0 - wb);
    return vec3(1.0 - wb - wc, wb, wc);
}

// a coordinate within [0, 1] of one period; modes are those of TextureWrap
float wrap_coordinate(float x, uint mode)
{
    if (mode == 2)
        return clamp(x, 0.0, 1.0);
    if (mode == 1) {
        const float two = x - 2.0 * floor(0.5 * x);
        return two > 1.0 ? 2.0 - two : two;
    }
    return x - floor(x);
}

// a texel next to one period: -1 or `size` at the ends
uint wrap_texel(int i, int size, uint mode)
{
    if (mode == 0)
        return uint(i < 0 ? i + size : (i >= size ? i - size : i));
    return uint(clamp(i, 0, size - 1));
}
