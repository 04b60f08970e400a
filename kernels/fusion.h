// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/sort.h"

// Ops that fuse depth images and take surfaces out of what they make, as those of kernels/network.h
namespace semrover {

// A truncated signed distance in blocks of 8 x 8 x 8 voxels of a box. Blocks are numbered x fastest; those that exist
// are bits of a bitmap, their index is the number of bits before theirs (tsdf_rank). The sample of voxel v lies at
// (v + 0.5) voxels from the box's lowest corner.
constexpr uint32_t kTsdfBlockVoxels = 512;
constexpr uint32_t kTsdfStateFields = 7, kTsdfVoteWords = 10; // words of a voxel while frames are added
constexpr uint32_t kTsdfFrameWords = 24;
struct TsdfOptions {
    uint32_t blocks_x = 1, blocks_y = 1, blocks_z = 1; // of the box
    float voxel = 0.1f;                                // metres
    float truncation = 0.4f;                           // metres
    float band = 0.2f;                                 // metres from the surface within which a pixel colours and votes
    float max_depth = 30;                              // metres; pixels beyond it see nothing
    float min_weight = 0;                              // voxels with less stay unobserved

    uint32_t bitmap_words() const { return divide_up(blocks_x * blocks_y * blocks_z, 32); }
};
struct TsdfFrames {
    Tensor frames; // [F, kTsdfFrameWords] fp32 array: fx fy cx cy; rotation [3, 3], world to camera; the camera's
                   // centre in voxels from the box's lowest corner, whole (i32 bits) and rest; width, height (0: no
                   // frame), first pixel (u32 bits); two unused
    Tensor pixels; // [P, 2] u32 array: depth (fp32 bits, metres; 0: nothing); rgb | label << 24
};

// the plane through every pixel's surface, N p = 1 in camera coordinates
[[nodiscard]] Tensor tsdf_planes(Graph& g, const TsdfFrames& frames,
                                 const TsdfOptions& options); // [P, 4] u32: N (0: nothing), rgb | label << 24
// sets the bits of the blocks within the truncation of a pixel's surface
void tsdf_touch(Graph& g, Tensor frames, Tensor planes, const TsdfOptions& options,
                Tensor bitmap);                                       // [bitmap_words] u32
[[nodiscard]] PrefixSum tsdf_rank(Graph& g, Tensor bitmap);           // bits before each word, and all
void tsdf_list(Graph& g, Tensor bitmap, Tensor ranks, Tensor blocks); // blocks: [bits] u32, ascending

// adds frames in order: projective distance to the pixel's plane, weighted; colour; one of 20 counters per voxel
struct TsdfState {
    Tensor blocks; // [B] u32
    Tensor state;  // [B * kTsdfStateFields * 512] fp32 array, zero before the first frame
    Tensor votes;  // [B * kTsdfVoteWords * 512] u32 array, likewise
};
void tsdf_integrate(Graph& g, Tensor frames, Tensor planes, const TsdfOptions& options, const TsdfState& state);
void tsdf_finish(Graph& g, const TsdfState& state, const TsdfOptions& options,
                 Tensor distances,   // [B * 512] fp32: in truncations, 2 where nothing was observed
                 Tensor attributes); // [B * 512] u32: rgb | label << 24 (31: none) | views << 29 (7: or more)

// The surface where the distance is 0, without cracks: on faces that are ambiguous, inside corners are cut off one by
// one in both cells. One vertex per crossed edge, kept by the edge's lower voxel; cells with an unobserved corner have
// none.
struct MarchingCubesField {
    uint32_t blocks_x = 1, blocks_y = 1, blocks_z = 1; // of the box
    Tensor bitmap, ranks, blocks, distances, attributes;
    uint32_t min_views = 0; // cells whose corners were all seen by fewer frames make no surface
    float max_jump = 4;     // nor do cells whose corners' distances, in truncations, are further apart
};
struct MarchingCubesCounts {
    Tensor cases;                    // [B * 512] u32
    Tensor edges;                    // [B * 512] u32
    Tensor first_vertex, first_face; // [B] u32: before each block
    Tensor vertices, faces;          // [1] u32: of all blocks
};
std::vector<uint32_t> marching_cubes_table(); // [256, 16]: faces, then three edges a face
// `counts` are tensors to write to
void marching_cubes_count(Graph& g, const MarchingCubesField& field, Tensor table, const MarchingCubesCounts& counts);
struct MarchingCubesRange { // of blocks
    uint32_t first = 0, count = 0;
    uint32_t first_vertex = 0, first_face = 0; // before them
};
void marching_cubes_vertices(Graph& g, const MarchingCubesField& field, const MarchingCubesCounts& counts,
                             const MarchingCubesRange& range,
                             Tensor vertices); // [.., 4] fp32: voxels from the block's first sample, attributes as bits
void marching_cubes_faces(Graph& g, const MarchingCubesField& field, const MarchingCubesCounts& counts, Tensor table,
                          const MarchingCubesRange& range, Tensor faces); // [.., 3] u32

} // namespace semrover
