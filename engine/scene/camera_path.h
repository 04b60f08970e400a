// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/camera.h"

namespace semrover {

// camera paths on disk; at most 16 MiB, all numbers finite. Errors are bad_input and name the file and the line or
// frame; a path without poses is one.

// TUM: a line `t tx ty tz qx qy qz qw` a pose, camera to world, OpenCV camera axes; `#` starts a comment. All frames
// get the given intrinsics. Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
Result<CameraPath> read_tum(const Path& path, const Intrinsics& intrinsics);

// the first camera's poses only fit one file: frames of several cameras are the caller's bug
Status write_tum(const Path& path, const CameraPath& cameras);

// nerfstudio's transforms.json: OpenGL camera axes (x right, y up, z back), camera to world. Intrinsics are w, h, fl_x,
// fl_y, cx, cy or camera_angle_x, in the file or overridden in a frame; where the file has no size, `fallback` gives it
// (and the focal lengths, if the file has none either). Lens distortion other than 0 and fisheye models are refused.
// `time` (seconds) defaults to the frame's index; `camera`, our addition, to no name. The world is the file's.
// Source: https://docs.nerf.studio/quickstart/data_conventions.html
Result<CameraPath> read_transforms(const Path& path, const std::optional<Intrinsics>& fallback = {});

// pictures are named [CAMERA/]color/NNNNNN.png, counted for each camera, as `render` writes them
Status write_transforms(const Path& path, const CameraPath& cameras);

// .json is read as transforms.json, any other name as TUM
Result<CameraPath> read_camera_path(const Path& path, const Intrinsics& fallback);

} // namespace semrover
