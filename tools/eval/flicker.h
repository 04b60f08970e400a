// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/depth_picture.h"

#include <limits>
#include <map>
#include <optional>

namespace semrover {

struct WarpOptions {
    double tolerance = 0.01; // relative: by how much the depths of both frames may differ
};

// what moves from the time of `to` to that of `from`, besides the camera
struct ThingMotions {
    std::vector<uint16_t> things = {}; // [height, width] of `to`: number of the thing that a pixel shows
    // of things in the world, none: it is not there any more; other things stand
    std::map<uint16_t, std::optional<Rigid>> motions = {};
};

// where the pixels of one frame were in another one, in a scene in which nothing but `motions` moves
struct Flow {
    struct Source {
        double x = std::numeric_limits<double>::quiet_NaN(), y = x; // pixel centres at whole numbers + 0.5
        bool valid() const { return x == x; }
    };
    std::vector<Source> sources; // [height, width]
    uint64_t with_depth = 0;     // pixels
};

// From the depth of `to`: its point in the world, seen by `from`. Valid where that lies between four pixel centres of
// `from` whose depths, interpolated as 1 / depth (exact on a plane through a pinhole), agree with it. Depths are along
// the optical axis or, where Lens::radial_depth says so, from the camera. Pictures have the cameras' sizes.
Flow flow_between(const CameraFrame& from, const DepthPicture& from_depth, const CameraFrame& to,
                  const DepthPicture& to_depth, const WarpOptions& options = {}, const ThingMotions& motions = {});

// differences of a frame from what the one before it has there, bilinear, over valid pixels: sums over three channels
struct WarpSums {
    uint64_t pixels = 0, with_depth = 0, valid = 0;
    double absolute = 0, squares = 0; // 0..255

    WarpSums& operator+=(const WarpSums& other);
    double mean() const; // of absolute differences of channels
    double rms() const;
    double share() const; // of pixels that are valid
};
WarpSums warped_difference(const Flow& flow, const ImageRgb8& from, const ImageRgb8& to);

} // namespace semrover
