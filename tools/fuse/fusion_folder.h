// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/depth_frames.h"
#include "engine/shards/shard_set.h"
#include "tools/dataset/depth_image.h"
#include "tools/dataset/picture_classes.h"
#include "tools/fuse/frame_pictures.h"
#include "tools/fuse/lens_views.h"
#include "tools/fuse/sweep_frames.h"
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
//   [CAMERA/]depth/NNNNNN.png  or .npy: depth_image.h; where there is none, LIDAR/sweeps.json and
//   LIDAR/points/NNNNNN.npy [CAMERA/]label/NNNNNN.png  or .npy: number_image.h; a folder without label/ has none at all
//   [CAMERA/]color/NNNNNN.png  or .jpg, likewise; used/ beside it: pixels that are 0 there are left out
// numbered by the frames of each camera. A frame of transforms.json may name its picture (file_path, relative to the
// folder): depth and label then have its name in depth/ and label/ beside the picture's folder, unless depth_file_path
// and label_file_path name them. COLMAP's pictures have names, too, and TUM RGB-D's times.
// Intrinsics are of pictures of the size that they say; they are scaled to depth, and so are colours and labels. What a
// lens or a lidar saw is fused as pinholes that look out of it (lens_views.h, sweep_frames.h).
class FusionFolder {
  public:
    // Reads poses, and the sizes of all pictures. Errors: bad_input for what is missing or named outside the folder,
    // and for pictures of other proportions than their camera's
    static Result<FusionFolder> open(const Path& folder, const FusionFolderOptions& options);

    // Reads all labels; without it frames have none. Errors: bad_input lists all numbers, with counts, where some are
    // neither a class nor nothing
    Status check_labels();

    const std::vector<CameraFrame>& cameras() const { return seen_; }      // of frames()
    size_t count() const { return pictures_.size(); }                      // pictures with poses
    bool has_sweeps() const { return bool(sweeps_); }                      // their pictures only colour and label
    size_t labelled() const;                                               // of these, with labels
    size_t colored() const;                                                // of these, with colours
    const std::vector<std::string>& warnings() const { return warnings_; } // a line each: what was taken for granted

    DepthFrames frames() const; // good as long as this is

  private:
    struct View {
        size_t frame;                          // of cameras_
        std::shared_ptr<const LensViews> lens; // none: a pinhole
        size_t number = 0;                     // of its views
    };
    struct Loaded { // the last frame: views of one follow each other
        size_t frame = ~size_t(0);
        DepthImages images;
        bool radial = false;
    };

    Status read_poses(const Path& poses, const FusionFolderOptions& options);
    Status find_frames(const Path& poses, const FusionFolderOptions& options);
    Status check_pictures();
    Status fit_intrinsics(size_t frame);
    Status note_encoding();
    void find_views();
    ImageSize depth_size(size_t frame) const;
    Result<DepthImages> load_view(const View& view) const;
    Status load_depth(size_t frame, Loaded& loaded) const;
    Result<std::vector<uint16_t>> numbers_of(const Path& path, size_t frame) const;
    Status load_labels(size_t frame, DepthImages& images) const;
    Status load_colors(size_t frame, DepthImages& images) const;
    Status mask_depth(size_t frame, DepthImages& images) const;
    Status load_picture(size_t frame, DepthImages& images) const;
    std::string name_of(size_t frame) const;

    ShardsOrNone shards_;
    Path folder_;
    std::optional<Path> lidar_; // its folder, where sweeps are the depth
    Rigid placed_ = kIdentity;  // the path's world in the grid's
    DepthEncoding encoding_;
    std::vector<CameraFrame> cameras_; // of pictures_
    std::vector<FramePictures> pictures_;
    std::vector<View> views_;
    std::vector<CameraFrame> seen_; // of views_, or of sweeps_
    std::shared_ptr<SweepFrames> sweeps_;
    std::shared_ptr<Loaded> loaded_ = std::make_shared<Loaded>();
    bool scaled_ = false;
    PictureClasses classes_;
    std::vector<std::string> warnings_;
};

} // namespace semrover
