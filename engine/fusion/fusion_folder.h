// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/path_placement.h"
#include "engine/format/label_map.h"
#include "engine/fusion/depth_frames.h"
#include "runtime/base/file.h"

#include <array>

namespace semrover {

struct FusionFolderOptions {
    Path poses;                           // any camera path; empty: transforms.json in the folder
    PathPlacement placement;              // of the path
    std::optional<double> fx, fy, cx, cy; // pixels; they override the files
    std::optional<double> fov_x;          // degrees across the width
    Path map;                             // JSON that says what label numbers are (label_map.h)
};

// A folder of pictures and poses:
//   transforms.json, or another camera path
//   intrinsics.json {"fx", "fy", "cx", "cy", "width", "height"}, where the path has none and no option gives them
//   [CAMERA/]depth/NNNNNN.png  16-bit gray, along the optical axis; 0 and 65535: nothing
//   [CAMERA/]label/NNNNNN.png  8-bit class number, 255: none; a folder without label/ has none at all
//   [CAMERA/]color/NNNNNN.png or .jpg, likewise
// numbered by the frames of each camera. A frame of transforms.json may name its picture (file_path, relative to the
// folder): depth and label then have its name in depth/ and label/ beside the picture's folder, unless depth_file_path
// and label_file_path name them.
class FusionFolder {
  public:
    // Reads poses, and the sizes of all pictures. Errors: bad_input for what is missing or named outside the folder,
    // for pictures of another size than their camera, for lenses other than a pinhole
    static Result<FusionFolder> open(const Path& folder, const FusionFolderOptions& options);

    // Reads all labels. Errors: bad_input lists labels that are neither a class nor 255, with counts
    Status check_labels();

    const std::vector<CameraFrame>& cameras() const { return cameras_; }
    const std::vector<std::string>& warnings() const { return warnings_; } // of the camera path
    size_t labelled() const;                                               // frames with labels
    size_t colored() const;                                                // frames with colours

    DepthFrames frames() const; // good as long as this is

  private:
    struct Pictures {
        Path depth, label, color; // label and color empty: none
    };

    Status read_poses(const Path& poses, const FusionFolderOptions& options);
    Status find_pictures(const Path& poses);
    Status check_pictures() const;
    Status check_count(const Path& poses) const;
    Result<DepthImages> load(size_t frame) const;
    Result<std::vector<uint8_t>> read_labels(size_t frame) const; // numbers of the file
    std::string name_of(size_t frame) const;

    Path folder_;
    std::vector<CameraFrame> cameras_;
    std::vector<std::string> warnings_;
    std::vector<Pictures> pictures_;
    LabelMap map_;
    std::array<uint8_t, 256> classes_{}; // of label numbers: a class, kLeftOut or kEmpty
};

} // namespace semrover
