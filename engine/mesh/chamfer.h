// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

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
    double to_surface = 0; // mean distance of the grid's points from the nearest point of the surface
    double to_points = 0;  // mean distance of surface samples from the nearest point of the grid
    double mean() const { return (to_surface + to_points) / 2; }
};

// how far a grid's points and a mesh are from each other. Errors: bad_input for a grid without points or a mesh without
// area, out_of_memory, device_lost
Result<Chamfer> chamfer(Device& device, const Mesh& mesh, const VoxelGrid& grid, const ChamferOptions& options = {});

} // namespace semrover
