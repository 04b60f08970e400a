// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "engine/scene/grid.h"
#include "runtime/device/device.h"

namespace semrover {

// where a voxel's points lie: on a lattice with a random shift, or the same in every voxel with the same surface
// (docs/method.md §1.3)
enum class PointPlacement : uint8_t { shifted, canonical };

struct VoxelizeOptions {
    float voxel_size = 0.6f;   // metres
    int points_per_voxel = 20; // 1..4096
    float min_area = 1e-4f;    // in squares of the voxel size: cells with less surface stay empty
    PointPlacement placement = PointPlacement::shifted;
    uint64_t seed = 0;                // of the shifts
    uint8_t default_label = kNoLabel; // of faces without one; kNoLabel: such faces are bad_input, with their area
    std::string name = "the mesh";    // in errors
    uint64_t max_pairs = 0; // triangles in voxels that are on the device at once; 0: as many as suit it. No result
                            // depends on it
};

struct VoxelizedMesh {
    VoxelGrid grid;          // points, colours, labels: of the largest area in the voxel, ties to the lower label
    std::vector<float> area; // [V] m^2 of surface in each voxel
};

// Voxels are half-open: a triangle in the plane between two voxels belongs to the upper one. Positions are rounded to
// 2^-20 of a voxel. A colour is the material's times the texture's (bilinear) times the vertices', in linear light,
// what is absent being white; a label is the face's, or the label texture's at the middle of what a voxel has of the
// face. Points lie within their voxel, in the order of a token. A textured mesh as a Sigma-Voxfield grid
// (docs/method.md §1.3): every triangle is clipped to the voxels it crosses, and a voxel's points are drawn uniformly
// and evenly over its clipped area (a randomly shifted lattice), with random numbers keyed by (seed, voxel, sample), so
// the result depends on neither the order of the faces within a voxel's reach nor on the device's threads. Errors:
// bad_input, out_of_memory, device_lost
Result<VoxelizedMesh> voxelize(Device& device, const Mesh& mesh, const VoxelizeOptions& options);

} // namespace semrover
