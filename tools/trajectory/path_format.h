// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <optional>
#include <string>
#include <string_view>

namespace semrover {

// which camera path a file or folder is, as its content shows; the first five are also written
enum class PathFormat {
    tum,
    kitti,
    transforms,
    camera_path,
    colmap,
    kitti360,
    matrices,
    redwood,
    pose_files,
    euroc,
    pandaset,
    nuscenes,
};
std::string_view name_of(PathFormat format);
std::optional<PathFormat> path_format_of(std::string_view name);

struct FoundPath {
    PathFormat format;
    Path path; // what is read: the file or folder itself, or what a folder holds, such as sparse/0 of a project
};

// none for what is no camera path, or not there; bad_input: it cannot be read
Result<std::optional<FoundPath>> find_path(const Path& path);

// bad_input: what the file or folder looks like, and what was expected: a camera path, or `others`
Status refuse_unknown_path(const Path& path, std::string_view others = "");

// Files of a 4x4 matrix each, by the numbers in their names: NNN.txt of ScanNet, frame-NNNNNN.pose.txt of 7-Scenes.
// Where names end in .pose.txt, others do not count. Empty where the first of them is no matrix. bad_input: the folder
// cannot be listed, or that file not read
Result<std::vector<Path>> pose_files_in(const Path& folder);

} // namespace semrover
