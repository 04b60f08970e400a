// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/fuse/sweep_surface.h"

#include <functional>

namespace semrover {

// Sweeps of a lidar as frames: a pinhole for each of the four sides. A pixel has the colour of the camera that sees its
// point nearest to the middle, of each camera's picture that is nearest in time, and the label of the lidar's return
// or, where that has none, the camera's. What no camera sees is left out where there are pictures. The lidar sees a
// little around edges that hide a thing from the camera; that is not looked for.
class SweepFrames {
  public:
    // loads colours and labels of a camera's picture at its size; either may be empty
    using LoadPicture = std::function<Result<DepthImages>(size_t frame)>;

    // sweeps lie in the world of `cameras`, after `placed`. Reads all points once. Errors: bad_input
    static Result<SweepFrames> open(const Path& lidar, const Rigid& placed, const std::vector<CameraFrame>& cameras);

    const std::vector<CameraFrame>& frames() const { return frames_; }
    // of pictures of `cameras` as open() had them
    Result<DepthImages> load(size_t frame, const std::vector<CameraFrame>& cameras, const LoadPicture& picture);

  private:
    struct Picture {
        size_t frame;
        DepthImages images;
    };

    Status load_sweep(size_t sweep, const LoadPicture& picture);
    void paint(const CameraFrame& view, const std::vector<CameraFrame>& cameras, DepthImages& images) const;

    std::vector<RecordedSweep> sweeps_;
    std::vector<PinholeView> views_;
    std::vector<CameraFrame> frames_;
    std::vector<std::vector<size_t>> pictures_of_; // of each sweep, a camera frame of each camera

    size_t loaded_ = ~size_t(0); // sweep
    std::optional<SweepSurface> surface_;
    std::vector<Picture> pictures_;
};

// the folder of the first lidar, by name, that has sweeps; none: there is none
Result<std::optional<Path>> find_lidar(const Path& folder);

} // namespace semrover
