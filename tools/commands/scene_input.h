// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/print_stderr.h"
#include "tools/dataset/scene_file.h"

#include <optional>

namespace CLI {
class App;
}

namespace semrover {

// how a command reads grids and splats of any format: what `convert`, `render`, `generate` and `inspect` share
struct SceneInputOptions {
    std::string from, map, origin, mask, label;
    std::optional<float> voxel_size;
    double file_voxel_size = 0, min_fill = 0;
    int points_per_voxel = 20;
    uint64_t seed = 0;
    bool labels_only = false, nearest_color = false;
    bool origin_may_be_of_path = false; // --origin is not refused for a grid that has its place already
    const CLI::App* command = nullptr;  // that they are options of; none: all have their defaults
};
void add_scene_input_options(CLI::App& command, SceneInputOptions& options);
std::span<const std::string_view> scene_input_options(); // their names

// whether --origin says where a grid of this format lies; others have their place already
bool has_origin(SceneFormat format);

// --origin as numbers; errors: usage
Result<std::array<double, 3>> origin_of(const SceneInputOptions& options);

// what a file holds: one of the two
struct SceneInput {
    SceneFormat format = SceneFormat::sgrid;
    std::optional<VoxelGrid> grid;
    std::optional<Splats> splats;
    std::vector<std::string> warnings;
    uint64_t dropped = 0;
};
// usage also for options that have no meaning for this format
Result<SceneInput> read_scene_input(const Path& path, const SceneInputOptions& options);

// a grid, with warnings printed; bad_input for splats
Result<VoxelGrid> load_grid(const Path& path, const SceneInputOptions& options, const Globals& globals);

} // namespace semrover
