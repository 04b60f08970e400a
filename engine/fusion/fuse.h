// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/tsdf_volume.h"
#include "engine/mesh/mesh.h"

namespace semrover {

// where the distance is 0: closed but for borders where something was not observed; every other edge has two faces
struct FusedSurface {
    std::vector<std::array<float, 3>> positions; // [V] metres, world
    std::vector<std::array<uint8_t, 3>> colors;  // [V] sRGB
    std::vector<uint8_t> labels;                 // [V] class or kNoLabel
    std::vector<uint8_t> views;                  // [V] frames that saw it; 7: or more
    std::vector<std::array<uint32_t, 3>> faces;  // [F] counter-clockwise seen from outside
};

// Errors: out_of_memory, device_lost
Result<FusedSurface> extract_surface(Device& device, const TsdfVolume& volume);

struct FusionFigures {
    size_t blocks = 0;   // of 8^3 voxels
    uint32_t chunks = 0; // that their votes were kept in
    size_t unlabelled_faces = 0;
};

struct FusedMesh {
    Mesh mesh;                  // vertex colours; face labels, kNoLabel where no pixel had one; a material a class
    std::vector<uint8_t> views; // [V] frames that saw a vertex; 7: or more
    FusionFigures figures;
};

// how far depths are worth using: where a pixel of the widest lens is 0.55 voxels wide, 30 m at most. Measured on a
// procedural street at 400x260: the 95th percentile of the error is 0.05 m with this limit of 15 m, 0.10 m at 20 m.
double suitable_max_depth(const std::vector<CameraFrame>& cameras, double voxel);

// Depth images to a mesh: truncated signed distance, 20 counters of votes per voxel, marching cubes. A face has the
// label that most of its corners have, ties to the lower one.
// Errors: what TsdfVolume::create says; bad_input when there is no surface
Result<FusedMesh> fuse(Device& device, const DepthFrames& frames, const FusionOptions& options,
                       const FusionProgress& progress = {});

} // namespace semrover
