// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

// Ops on triangle meshes in voxels, as those of kernels/network.h
namespace semrover {

// Triangles are given for each block of 8^3 voxels that they touch; a slot is a block, or a range of its voxels. The
// key of voxel (x, y, z) of a slot is slot * 512 + (x * 8 + y) * 8 + z. A voxel spans [x, x + 1) x [y, y + 1) x [z, z +
// 1).
constexpr uint32_t kSurfaceBlock = 8, kSurfaceBlockCells = 512, kNoSurfaceLabel = 20, kSurfacePlaceBits = 9;
struct SurfaceTriangles { // words: u32, or the bits of a float
    Tensor records;    // [T, 12]: three corners in voxels from the block's corner (floats within +-16); slot; its range
                       // of voxels (four bits each: first x, y, z, end x, y, z); material | label << 24
    Tensor attributes; // [T, 16]: u, v of the corners (floats); their linear r, g, b (floats); their alpha (bytes)
    Tensor materials;  // [M, 8]: linear r, g, b (floats); texture, label texture, texture of alpha (2^32 - 1: none);
                       // alpha that texture times corners reach where there is a surface (float; 0: everywhere); 1 if
                       // alpha and colour are of one texture
    Tensor textures;   // [X, 4]: width, height, address of the first texel, wrap of u | wrap of v << 2 (TextureWrap)
    Tensor alphas;     // [N] of those that materials name for alpha, a byte a texel, four a word
    bool masked = false; // whether any material has a threshold; else alpha is not looked at
};

// the voxels that a triangle may have area in: those that its box and its plane touch
struct SurfacePairs {
    Tensor keys;      // [capacity] u32, of voxels; as triangle_cells() makes them, << kSurfacePlaceBits with the Morton
                      // code of where in the voxel the triangle lies below
    Tensor triangles; // [capacity] u32
    Tensor count;     // [1] u32
};
[[nodiscard]] SurfacePairs triangle_cells(Graph& g,
                                          Tensor records,     // [T, 12], as above
                                          uint32_t capacity); // pairs; the caller knows that they fit

// y[i] = x[i] >> kSurfacePlaceBits: the voxels alone, once pairs are sorted
[[nodiscard]] Tensor pair_cells(Graph& g, Tensor keys); // [N] u32 -> [N] u32

// the area of each pair's triangle within its voxel, by exact clipping; of masked ones the share with a surface, of 64
// places
struct SurfaceAreas {
    Tensor areas;           // [capacity] fp32, in squares of a voxel's edge
    Tensor labels;          // [capacity] u32, of the triangles; kNoSurfaceLabel: none
    Tensor label_addresses; // [capacity] u32: of the texel that says the label; 2^32 - 1: none
};
[[nodiscard]] SurfaceAreas clip_area(Graph& g, const SurfaceTriangles& surface, const SurfacePairs& pairs);

// y[i] = page[address[i] - first] where that is in the page; else y[i] stays
void gather_texels(Graph& g,
                   Tensor addresses, // [N] u32
                   Tensor page,      // [texels] u32
                   uint32_t first,
                   Tensor y,           // [N] u32, in place
                   Tensor count = {}); // [1] u32, or none: only the first count[0] addresses are there

// area and label of voxels, in the order of their pairs
struct CellAreas {
    Tensor sums;       // [pairs] fp32: area of the voxel up to and with this pair, never falling
    Tensor areas;      // [voxels] fp32, in squares of a voxel's edge
    Tensor labels;     // [voxels] u32: of the largest area, ties to the lower one; kNoSurfaceLabel where none has any
    Tensor unlabelled; // [voxels] fp32: area without a label
};
[[nodiscard]] CellAreas cell_area(Graph& g,
                                  Tensor areas,  // [pairs] fp32, sorted by voxel
                                  Tensor labels, // [pairs] u32
                                  Tensor starts, // [voxels + 1] u32: bucket_starts() of the keys
                                  uint32_t cells);

// points drawn uniformly from the surface in voxels, Philox4x32-10 keyed by (seed, voxel, sample); canonical: where
// samples of any other voxel with the same surface lie, nothing is random
struct SurfaceSamples {
    Tensor points; // [voxels * samples, 8] fp32: offset from the voxel's centre in voxels; where the point lies between
                   // its four texels, right and down; linear factor of the colour, r g b
    Tensor addresses; // [voxels * samples, 4] u32: of the texels; 2^32 - 1: none
};
[[nodiscard]] SurfaceSamples sample_surface(Graph& g, const SurfaceTriangles& surface,
                                            Tensor triangles, // [pairs] u32, sorted by voxel
                                            Tensor sums,      // [pairs] fp32: of cell_area()
                                            Tensor starts,    // [keys + 1] u32
                                            Tensor cells,     // [voxels, 4] i32: i, j, k, key; each has area
                                            uint32_t samples, uint64_t seed, bool canonical = false);

// y = offset (bits of three floats); the colour: texels bilinearly in linear light times the factor, as sRGB bytes
[[nodiscard]] Tensor surface_color(Graph& g, const SurfaceSamples& samples,
                                   Tensor texels,  // [voxels * samples, 4] u32: sRGB bytes, r lowest
                                   Tensor linear); // [512] fp32: linear value of sRGB bytes v, then of v + 0.5
                                                   // -> [voxels * samples, 4] u32

// Boxes around triangles, as engine/mesh/bvh.h makes them, at most 48 levels
struct SurfaceTree {
    Tensor nodes;     // [nodes, 16]
    Tensor triangles; // [T, 10] u32: three corners (floats as bits), face
};

// y = the nearest triangle of points, where it is nearer than y; ties to the lower face
void surface_distance(Graph& g,
                      Tensor points, // [P, 3 or more] fp32 array
                      const SurfaceTree& tree,
                      Tensor y); // [P, 2] u32 array, in place: distance (bits of a float >= 0 whose square is finite),
                                 // face

} // namespace semrover
