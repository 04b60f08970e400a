// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/voxelizer.h"
#include "tools/cli/value_options.h"

namespace semrover {

// --placement of the commands that place points
inline CLI::Option* add_placement(CLI::App& c, VoxelizeOptions& o)
{
    return add_choice(
        c, "--placement", {"shifted", "canonical"},
        "shifted (a lattice with a random shift in each voxel) or canonical (the same in every flat voxel)",
        [&o](const std::string& text) {
            o.placement = text == "canonical" ? PointPlacement::canonical : PointPlacement::shifted;
        });
}

} // namespace semrover
