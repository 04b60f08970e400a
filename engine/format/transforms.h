// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rig.h"
#include "engine/format/depth_picture.h"
#include "engine/format/picture_encoding.h"
#include "runtime/base/json.h"

#include <functional>

namespace semrover {

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
std::string picture_name(const std::string& camera, std::string_view kind, uint32_t number,
                         std::string_view extension = "png");

// What lies beside a transforms.json, from its folder on.
struct PictureNames {
    std::string color, depth, label; // empty: there is none
};
struct TransformsFiles {
    // of a frame of a camera (its number in the file); empty: colours only, named by picture_name
    std::function<PictureNames(const std::string& camera, uint32_t number)> pictures;
    std::string points;              // a .ply in the path's world; empty: none
    double depth_unit = kMillimetre; // metres of what depth pictures hold
};
// The names that `render` gives to pictures.
PictureNames rendered_pictures(const std::string& camera, uint32_t number, const PictureEncoding& encoding = {});

// metres of a unit of depth pictures, as the transforms.json of their folder says; else 0.001. bad_input: not above 0
Result<double> read_depth_unit(const Path& folder);

// Intrinsics are at the top where all frames share them, else in every frame: nerfstudio takes what is at the top for
// all frames. `rig`, our addition, has the sensors as a rig.json does.
Status write_transforms(const Path& path, const CameraPath& cameras, const TransformsFiles& files = {});

} // namespace semrover
