// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/path_placement.h"
#include "engine/format/path_format.h"
#include "engine/format/ply.h"
#include "runtime/base/json.h"

#include <functional>

namespace semrover {

// camera paths on disk; at most 16 MiB, all numbers finite. Errors are bad_input and name the file and the line or
// frame; a path without poses is one. A lens whose distortion is 0 is read as a pinhole. The world is the file's.

// the lens of a path that has none in its file
struct PathLens {
    PathLens(const Intrinsics& k, bool size = true, bool view = true)
        : intrinsics(k), size_given(size), view_given(view)
    {
    }

    Intrinsics intrinsics;
    bool size_given, view_given; // else they are defaults: that they are taken is among CameraPath::warnings
    bool matters = true;         // false: only where cameras are and look; calibrations are not read
};

// that a default field of view is taken, as CameraPath::warnings say it
std::string default_view_text(std::string_view name, const Intrinsics& lens);
// that a body's poses are read as a camera's; where no rig says where cameras sit on it
std::string body_text(std::string_view name, const PathBody& body);

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

// transforms.json of nerfstudio, instant-ngp and exporters from Blender: OpenGL camera axes (x right, y up, z back),
// camera to world. Intrinsics are w, h, fl_x, fl_y, cx, cy, or a field of view in place of a focal length
// (camera_angle_x, camera_angle_y in radians; x_fov, y_fov in degrees), camera_model (OPENCV, PINHOLE, SIMPLE_PINHOLE,
// SIMPLE_RADIAL, RADIAL, FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, FISHEYE, SIMPLE_FISHEYE,
// EQUIRECTANGULAR) or is_fisheye, and k1.., p1, p2, in the file or overridden in a frame. Without w and h the size is
// that of `lens`, if it is given, or of the picture in `folder`; else the default's, unless the focal length is in
// pixels. Keys of other lenses are refused by name. `time` (seconds) defaults to the frame's index; `camera`, our
// addition, to no name.
// Sources: https://docs.nerf.studio/quickstart/data_conventions.html, src/nerf_loader.cu of NVlabs/instant-ngp
Result<CameraPath> read_transforms(const Path& path, const std::optional<PathLens>& lens = {});
Result<CameraPath> parse_transforms(const Json& file, std::string_view name, const std::optional<PathLens>& lens = {},
                                    const Path& folder = {});

// [CAMERA/]KIND/NNNNNN.png, as `render` writes them
std::string picture_name(const std::string& camera, std::string_view kind, uint32_t number);

// What lies beside a transforms.json, from its folder on.
struct PictureNames {
    std::string color, depth, label; // empty: there is none
};
struct TransformsFiles {
    // of a frame of a camera (its number in the file); empty: colours only, named by picture_name
    std::function<PictureNames(const std::string& camera, uint32_t number)> pictures;
    std::string points; // a .ply in the path's world; empty: none
};
// The names that `render` gives to pictures.
PictureNames rendered_pictures(const std::string& camera, uint32_t number);

// Intrinsics are at the top where all frames share them, else in every frame: nerfstudio takes what is at the top for
// all frames. depth_unit_scale_factor is 0.001: depth pictures hold millimetres. `rig`, our addition, has the sensors
// as a rig.json does.
Status write_transforms(const Path& path, const CameraPath& cameras, const TransformsFiles& files = {});

// nerfstudio's camera_path.json: OpenGL camera axes; camera_type perspective, fisheye or equirectangular, one size, a
// vertical field of view in degrees for each frame (of a fisheye too it gives the focal length as of a pinhole). Times
// are render_time where all frames have one, else from fps. Source: nerfstudio/cameras/camera_paths.py
Result<CameraPath> read_camera_path_json(const Path& path);
Result<CameraPath> parse_camera_path_json(const Json& file, std::string_view name);

// bad_input for what it has no place for: distortion, a centre off the middle, several sizes
Status write_camera_path_json(const Path& path, const CameraPath& cameras);

// a folder of COLMAP's model: cameras.bin and images.bin or, where they are not, cameras.txt and images.txt (at most
// 256 MiB); w first, world to camera. Lenses: colmap_models.h. Other files are not looked at. Frames come in the order
// of their pictures' names (natural_order.h), moment by moment where the pictures lie in folders of several cameras;
// the n-th of a camera has the time n. Source: https://colmap.github.io/format.html
Result<CameraPath> read_colmap(const Path& folder);
// The text model; bad_input where a binary model is in the folder. Pictures of one camera are named as `render` names
// them; of several, front/front_000000.png: loaders that take the last part of a name keep them apart. Of `points`,
// positions and colours go to points3D.txt, where training begins.
Status write_colmap(const Path& folder, const CameraPath& cameras, const Surfels& points = {});
std::string colmap_picture_name(const std::string& camera, uint32_t number, size_t cameras);
// bad_input for a file of such a model, which is read as a folder; its names are cameras.bin, images.txt and the like
Status refuse_colmap_file(const Path& path);

// Paths that are read and not written; see path_format.h for how they are recognised. Poses are a pose to the world.
// - KITTI-360: a frame's number and 12 (poses.txt, of the IMU: x forward, y right, z down) or 16 numbers a line
//   (cam0_to_world.txt, of the camera). https://www.cvlibs.net/datasets/kitti-360/documentation.php
// - matrices: 16 numbers a line (Replica), or four lines of four, of a camera
// - Redwood and Open3D: a line of three numbers, the first of them the frame's, and four lines of four, of a camera
// - a folder with a file of four lines of four for each frame (ScanNet, 7-Scenes), of a camera; in the order of the
//   numbers in their names. Frames without a pose, which ScanNet fills with inf, are left out, with a warning
// - EuRoC: lines time (ns), p x y z, q w x y z, with commas, of the IMU (x up, y right, z forward); a heading that has
//   q_w last is followed. https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets
Result<CameraPath> read_kitti360(const Path& path, const Intrinsics& lens);
Result<CameraPath> read_matrices(const Path& path, const Intrinsics& lens);
Result<CameraPath> read_redwood(const Path& path, const Intrinsics& lens);
Result<CameraPath> read_pose_files(const Path& folder, const Intrinsics& lens);
Result<CameraPath> read_euroc(const Path& path, const Intrinsics& lens);
// - PandaSet's poses.json of a camera, with intrinsics.json and timestamps.json where they are beside it, or of the
//   lidar (x right, y forward, z up), whose folder is called so. https://github.com/scaleapi/pandaset-devkit
// - nuScenes' ego_pose.json, of the vehicle, in the order of their times. Where sample_data.json is beside it, those of
//   the key frames of the lidar on the roof. https://www.nuscenes.org/nuscenes#data-format
Result<CameraPath> read_pandaset(const Path& path, const PathLens& lens);
Result<CameraPath> read_nuscenes_poses(const Path& path, const Intrinsics& lens);

// Reads a path in the format that its content shows (path_format.h), and places it in the grid's world. KITTI's
// times.txt and calib.txt are read if they are beside the poses, or in ../sequences/NN as the data set has them.
Result<CameraPath> read_camera_path(const Path& path, const PathLens& lens, const PathPlacement& placement = {});

} // namespace semrover
