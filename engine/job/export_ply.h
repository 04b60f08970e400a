// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "runtime/device/device.h"

#include <string>

namespace semrover {

// where a grid's points go as PLY; empty paths are not written
struct PlyExports {
    std::string points;    // x y z, colour, label
    std::string splats_3d; // 3DGS
    std::string splats_2d; // 2DGS
    bool any() const { return !points.empty() || !splats_3d.empty() || !splats_2d.empty(); }
};

// normals come from the device; sigma as `render` draws it by default
Status export_ply(Device& device, const VoxelGrid& grid, const PlyExports& exports);

} // namespace semrover
