// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "engine/mesh/mesh.h"
#include "engine/scene/grid.h"
#include "runtime/device/device.h"

namespace semrover {

struct ChamferOptions {
    uint32_t samples = 200000; // of the surface, uniform over its area
    uint64_t seed = 0;
};

// metres
struct Chamfer {
    double to_surface = 0; // mean distance of the points from the nearest point of the surface
    double to_points = 0;  // mean distance of surface samples from the nearest of the points
    double squares = 0;    // m^2, the sum of both means of squares: PyTorch3D's chamfer_distance
    double mean() const { return (to_surface + to_points) / 2; }
};

// points to be measured, and about how far apart they lie, metres: the edge of a voxel of several
struct MeasuredPoints {
    std::vector<Point3> positions; // world, metres
    double spacing = 0.6;
};
// of cells that have some. cell_edge: of a mesh far from the origin (surface_blocks.h); none: the grid's voxel size
MeasuredPoints measured_points(const VoxelGrid& grid, std::optional<double> cell_edge = {});
MeasuredPoints measured_points(std::vector<Point3> positions);

// How far points are from a mesh, or from other points, which then are all samples of the surface.
// Errors: bad_input for no points or a mesh without area, out_of_memory, device_lost
Result<Chamfer> chamfer(Device& device, const Mesh& mesh, const MeasuredPoints& points,
                        const ChamferOptions& options = {});
Result<Chamfer> chamfer(Device& device, const MeasuredPoints& truth, const MeasuredPoints& points);

} // namespace semrover
