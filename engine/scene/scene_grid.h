// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <array>
#include <optional>

namespace semrover {

constexpr float kDefaultVoxelSize = 0.6f; // metres

// Options for reading other programs' files as a grid; each format uses those that concern it.
struct SceneGridOptions {
    Path map;                             // what source labels are: a table's name, or JSON (label_map.h)
    std::optional<float> voxel_size;      // metres, of the grid; none: as the file's own voxels, else 0.6
    std::array<double, 3> origin{};       // metres: where the file's origin lies in the world
    double file_voxel_size = 0;           // metres of a voxel of a file that does not say it; 0: as voxel_size
    double min_fill = 0;                  // smaller voxels: share of a cell's volume that makes it a cell; 0: any
    std::string mask;                     // .npz: an array of 0 and 1 that says which voxels count
    int points_per_voxel = 20;            // of points with colours
    uint64_t seed = 0;                    // which points stay where a voxel has more
    bool labels_only = false;             // whatever the points' colours
    bool nearest_color = false;           // .vox: a colour of no class counts as the nearest class's
    std::optional<uint8_t> default_label; // of points without one

    float cell_size() const { return voxel_size.value_or(kDefaultVoxelSize); }
};

// a field of SceneGridOptions that a file has no use for, and why
struct UnusedOption {
    std::string_view field, reason;
};

struct SceneGrid {
    VoxelGrid grid;
    std::vector<std::string> warnings; // a line each
    uint64_t dropped = 0;              // voxels or points of the file that are not in the grid
    std::vector<UnusedOption> unused;
};

} // namespace semrover
