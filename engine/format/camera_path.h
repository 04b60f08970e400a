// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "runtime/base/json.h"

namespace semrover {

// camera paths on disk; at most 16 MiB, all numbers finite. Errors are bad_input and name the file and the line or
// frame; a path without poses is one. A lens whose distortion is 0 is read as a pinhole. The world is the file's.

// TUM: a line `t tx ty tz qx qy qz qw` a pose, camera to world, OpenCV camera axes; `#` starts a comment. All frames
// get the given intrinsics. Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
Result<CameraPath> read_tum(const Path& path, const Intrinsics& intrinsics);

// frames of several cameras are the caller's bug, here and in the other formats of one camera
Status write_tum(const Path& path, const CameraPath& cameras);

// KITTI odometry: a line of 12 numbers a pose, the upper rows of camera to world, OpenCV camera axes. Times, a line
// each, and P0 of the calibration are in files of their own; without them a frame's time is its index, and the
// intrinsics are the given ones. The pictures' size is that of the calibration's S_rect_00 or, as odometry has none,
// the given one's. bad_input where a calibration is read and neither is there, and where the principal point is nowhere
// near the middle. KITTI counts pixels from the centre of the first: 0.5 is added to cx and cy, and subtracted in
// files that are written. Source: the devkit's readme, https://www.cvlibs.net/datasets/kitti
struct KittiFiles {
    Path times, calibration; // empty: none
    bool size_given = true;  // whether the intrinsics' size is what the caller means
};
Result<CameraPath> read_kitti(const Path& path, const Intrinsics& intrinsics, const KittiFiles& files = {});
// also times.txt and, unless lenses are distorted or differ, calib.txt beside it: read_camera_path finds them there
Status write_kitti(const Path& path, const CameraPath& cameras);
bool has_kitti_calibration(const CameraPath& cameras); // whether calib.txt can hold their lens

// nerfstudio's transforms.json: OpenGL camera axes (x right, y up, z back), camera to world. Intrinsics are w, h, fl_x,
// fl_y, cx, cy or camera_angle_x, camera_model (OPENCV, PINHOLE, SIMPLE_RADIAL, RADIAL, FULL_OPENCV, OPENCV_FISHEYE,
// EQUIRECTANGULAR) and k1.., p1, p2, in the file or overridden in a frame; where the file has no size, `fallback` gives
// it (and the focal lengths, if the file has none either).
// `time` (seconds) defaults to the frame's index; `camera`, our addition, to no name.
// Source: https://docs.nerf.studio/quickstart/data_conventions.html
Result<CameraPath> read_transforms(const Path& path, const std::optional<Intrinsics>& fallback = {});
Result<CameraPath> parse_transforms(const Json& file, std::string_view name,
                                    const std::optional<Intrinsics>& fallback = {});

// pictures are named [CAMERA/]color/NNNNNN.png, counted for each camera, as `render` writes them
Status write_transforms(const Path& path, const CameraPath& cameras);

// nerfstudio's camera_path.json: OpenGL camera axes; camera_type perspective, fisheye or equirectangular, one size, a
// vertical field of view in degrees for each frame (of a fisheye too it gives the focal length as of a pinhole). Times
// are render_time where all frames have one, else from fps. Source: nerfstudio/cameras/camera_paths.py
Result<CameraPath> read_camera_path_json(const Path& path);
Result<CameraPath> parse_camera_path_json(const Json& file, std::string_view name);

// bad_input for what it has no place for: distortion, a centre off the middle, several sizes
Status write_camera_path_json(const Path& path, const CameraPath& cameras);

// a folder of COLMAP's model: cameras.bin and images.bin or, where they are not, cameras.txt and images.txt (at most
// 256 MiB); w first, world to camera. Lenses: colmap_models.h. Other files are not looked at. Frames come in the order
// of their pictures' names, moment by moment where the pictures lie in folders of several cameras; the n-th of a camera
// has the time n. Source: https://colmap.github.io/format.html
Result<CameraPath> read_colmap(const Path& folder);
// the text model, pictures named as write_transforms does; bad_input where a binary model is in the folder
Status write_colmap(const Path& folder, const CameraPath& cameras);
// bad_input for a binary file of such a model, which is read as a folder; its names are cameras.bin and the like
Status refuse_colmap_file(const Path& path);

enum class PathFormat { tum, kitti, transforms, camera_path, colmap };
std::string_view name_of(PathFormat format);
std::optional<PathFormat> path_format_of(std::string_view name);

// Reads a path in the format that its content shows: a folder with cameras.bin, cameras.txt or KITTI's poses.txt, JSON
// with camera_path or frames, text with 12 or else 8 numbers a line. KITTI's times.txt and calib.txt are read if they
// are beside the poses, or in ../sequences/NN as the data set has them. `fallback` is used only for formats without
// intrinsics (TUM, KITTI, a transforms.json of poses); `size_given`: whether its size is meant, see KittiFiles.
Result<CameraPath> read_camera_path(const Path& path, const Intrinsics& fallback, bool size_given = true);

} // namespace semrover
