// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/depth_frames.h"
#include "engine/shards/shard_set.h"
#include "tools/dataset/depth_image.h"
#include "tools/dataset/picture_classes.h"
#include "tools/fuse/frame_pictures.h"
#include "tools/trajectory/camera_path.h"

namespace semrover {

struct FusionFolderOptions {
    Path poses;                           // any camera path; empty: transforms.json, or groundtruth.txt, in the folder
    PathPlacement placement;              // of the path
    std::optional<double> fx, fy, cx, cy; // pixels; they override the files
    std::optional<double> fov_x;          // degrees across the width
    DepthEncoding depth;
    Path map; // JSON that says what label numbers are (label_map.h)
};

// A folder of pictures and poses, or a shard set of one:
//   transforms.json, or another camera path
//   intrinsics.json {"fx", "fy", "cx", "cy", "width", "height"}, where the path has none and no option gives them
//   [CAMERA/]depth/NNNNNN.png  or .npy: depth_image.h
//   [CAMERA/]label/NNNNNN.png  or .npy: number_image.h; a folder without label/ has none at all
//   [CAMERA/]color/NNNNNN.png  or .jpg, likewise
// numbered by the frames of each camera. A frame of transforms.json may name its picture (file_path, relative to the
// folder): depth and label then have its name in depth/ and label/ beside the picture's folder, unless depth_file_path
// and label_file_path name them. COLMAP's pictures have names, too, and TUM RGB-D's times.
// Intrinsics are of pictures of the size that they say; they are scaled to depth, and so are colours and labels.
class FusionFolder {
  public:
    // Reads poses, and the sizes of all pictures. Errors: bad_input for what is missing or named outside the folder,
    // for pictures of other proportions than their camera's, for lenses other than a pinhole
    static Result<FusionFolder> open(const Path& folder, const FusionFolderOptions& options);

    // Reads all labels; without it frames have none. Errors: bad_input lists all numbers, with counts, where some are
    // neither a class nor nothing
    Status check_labels();

    const std::vector<CameraFrame>& cameras() const { return cameras_; }
    size_t labelled() const;                                               // frames with labels
    size_t colored() const;                                                // frames with colours
    const std::vector<std::string>& warnings() const { return warnings_; } // a line each: what was taken for granted

    DepthFrames frames() const; // good as long as this is

  private:
    Status read_poses(const Path& poses, const FusionFolderOptions& options);
    Status find_frames(const Path& poses, const FusionFolderOptions& options);
    Status check_pictures();
    Status fit_intrinsics(size_t frame);
    Status note_encoding();
    ImageSize depth_size(size_t frame) const;
    Result<DepthImages> load(size_t frame) const;
    Status load_labels(size_t frame, DepthImages& images) const;
    std::string name_of(size_t frame) const;

    ShardsOrNone shards_;
    Path folder_;
    DepthEncoding encoding_;
    std::vector<CameraFrame> cameras_;
    std::vector<FramePictures> pictures_;
    bool scaled_ = false;
    PictureClasses classes_;
    std::vector<std::string> warnings_;
};

} // namespace semrover
