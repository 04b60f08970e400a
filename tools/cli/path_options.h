// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/trajectory/path_placement.h"

#include <nlohmann/json_fwd.hpp>
#include <span>

namespace CLI {
class App;
}

namespace semrover {

// How a trajectory comes into the grid's world: one group of options of every command that reads a path.
// docs/formats.md §7.4
struct PathOptions {
    std::string world, relative_to, calibration, origin;

    bool any() const { return !world.empty() || !relative_to.empty() || !calibration.empty() || !origin.empty(); }
};
// note: a command that has --calib or --origin for its other inputs keeps them, and hands them over itself; the path's
// origin is then --path-origin
void add_placement_options(CLI::App& command, PathOptions& options);
std::span<const std::string_view> placement_options(); // their names

nlohmann::json json_of(const PathOptions& options); // those that are given, for a run's settings

Result<PathPlacement> placement_of(const PathOptions& options); // usage; bad_input

} // namespace semrover
