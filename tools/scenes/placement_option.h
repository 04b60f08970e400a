// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/voxelizer.h"

#include <CLI/CLI.hpp>

namespace semrover {

// --placement of the commands that place points
inline void add_placement(CLI::App& c, VoxelizeOptions& o)
{
    c.add_option_function<std::string>(
         "--placement",
         [&o](const std::string& text) {
             o.placement = text == "canonical" ? PointPlacement::canonical : PointPlacement::shifted;
         },
         "shifted (a lattice with a random shift in each cell) or canonical (the same in every flat cell)")
        ->check(CLI::IsMember({"shifted", "canonical"}));
}

} // namespace semrover
