// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/ply.h"
#include "engine/format/transforms.h"
#include "tools/trajectory/path_format.h"

namespace semrover {

// How the world of a camera path lies in that of a grid. In this order: poses become those relative to a frame, then
// the lidar's in place of the camera's, then `world` is applied, then `origin` is added to positions.
struct PathPlacement {
    static constexpr uint64_t kFirst = ~0ull;

    std::optional<uint64_t> relative_to;  // a frame: its number in the file or, where files give none, counted from 0
    std::optional<Rigid> lidar_to_camera; // KITTI's Tr; without relative_to, relative to the first frame
    Rigid world = kIdentity;              // the path's world to the grid's
    Point3 origin{};                      // where the path's origin lies in the grid's world
};

// bad_input, with `where` in front: no such frame; a lidar's calibration for poses that are no camera's
Status place_path(CameraPath& path, const PathPlacement& placement, std::string_view where);

// camera paths on disk; at most 16 MiB, all numbers finite. Errors are bad_input and name the file and the line or
// frame; a path without poses is one. A lens whose distortion is 0 is read as a pinhole. The world is the file's.

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

// nerfstudio's camera_path.json: OpenGL camera axes; camera_type perspective, fisheye or equirectangular, one size, a
// vertical field of view in degrees for each frame (of a fisheye too it gives the focal length as of a pinhole). Times
// are render_time where all frames have one, else from fps. Source: nerfstudio/cameras/camera_paths.py
Result<CameraPath> read_camera_path_json(const Path& path);
Result<CameraPath> parse_camera_path_json(const Json& file, std::string_view name);

// bad_input for what it has no place for: distortion, a centre off the middle, several sizes
Status write_camera_path_json(const Path& path, const CameraPath& cameras);

// a folder of COLMAP's model: cameras.bin and images.bin or, where they are not, cameras.txt and images.txt (at most
// 256 MiB); w first, world to camera. Lenses: colmap_models.h. Other files are not looked at. Frames come in the order
// of their pictures' names (natural_less), moment by moment where the pictures lie in folders of several cameras;
// the n-th of a camera has the time n. Source: https://colmap.github.io/format.html
Result<CameraPath> read_colmap(const Path& folder);
// The text model; bad_input where a binary model is in the folder. Pictures of one camera are named as `render` names
// them; of several, front/front_000000.png: loaders that take the last part of a name keep them apart. Of `points`,
// positions and colours go to points3D.txt, where training begins. extension: of the pictures, png or jpg
Status write_colmap(const Path& folder, const CameraPath& cameras, const Splats& points = {},
                    std::string_view extension = "png");
std::string colmap_picture_name(const std::string& camera, uint32_t number, size_t cameras,
                                std::string_view extension = "png");
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
