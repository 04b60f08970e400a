// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

namespace semrover {

// where the pictures of a frame lie; label and color empty: none
struct FramePictures {
    Path depth, label, color;
};

constexpr std::string_view kPictureEndings[] = {".png", ".jpg", ".jpeg", ".npy"};

// a path of a file, kept inside the folder; bad_input, with `where` in front
Result<Path> path_inside(const Path& folder, std::string_view text, std::string_view where);

// the file with this name and one of the endings that pictures of its kind have; the name itself where there is none
Path with_ending(Path picture);

// Pictures of frames that a path names (transforms.json, COLMAP) or that are numbered for each camera. A kind that has
// no folder has none. Errors: bad_input for names that lead outside the folder, and for more numbered pictures than
// poses; whether each file is there is not looked at
Result<std::vector<FramePictures>> find_pictures(const Path& folder, const Path& poses,
                                                 const std::vector<CameraFrame>& cameras);

} // namespace semrover
