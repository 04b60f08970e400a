// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/splat_file.h"
#include "engine/scene/scene_grid.h"

#include <span>

namespace semrover {

enum class SceneFormat : uint8_t {
    sgrid,
    npz,
    semantickitti,
    occ3d_nuscenes,
    occ3d_waymo,
    array,
    vox,
    points_ply,
    carla_points,
    gaussian_3d,
    gaussian_2d,
    inria62,
    gltf_splats,
    splat,
};

struct SceneFormatFacts {
    SceneFormat format;
    std::string_view name;       // as --from and --to have it
    std::string_view extensions; // with blanks between
    bool splats;                 // else a grid
    bool writable;
};
std::span<const SceneFormatFacts> scene_formats();
const SceneFormatFacts& facts_of(SceneFormat format);
std::optional<SceneFormat> scene_format_of_name(std::string_view name);

// whether a path's extension is one of a scene's, or of a format of splats that is named when it is refused
bool has_scene_extension(const Path& path);

// what a file is: by its extension; of .ply by whether it has splats' properties, of .npz by the names and shapes of
// its arrays (an array of labels, where that is the only one). bad_input for other extensions, and for a .ply or .npz
// that cannot be read
Result<SceneFormat> detect_scene_format(const Path& path);

// The format to write, by the path's extension: .ply is labelled points. bad_input lists the formats.
Result<SceneFormat> scene_format_to_write(const Path& path);

// Reads a grid in any format; `format` overrides the detected one. Errors: bad_input
Result<SceneGrid> read_scene_grid(const Path& path, const SceneGridOptions& options = {},
                                  std::optional<SceneFormat> format = {});
// Writes atomically. `warnings` gets a line for each kind of content that the format cannot hold.
Status write_scene_grid(const Path& path, const VoxelGrid& grid, SceneFormat format,
                        std::vector<std::string>& warnings);

Result<SplatFile> read_splats(const Path& path, SceneFormat format);
// `labels`: also a label in PLY files, for readers by property name
Status write_splats(const Path& path, const Splats& splats, SceneFormat format, bool labels);

} // namespace semrover
