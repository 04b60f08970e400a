// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/lens.h"
#include "engine/fusion/depth_frames.h"

namespace semrover {

// a pinhole that looks out of a sensor
struct PinholeView {
    Intrinsics intrinsics;
    Rigid from_sensor = kIdentity; // its axes to the view's, a rotation
};

// Pinholes that together see what a lens sees, with as many pixels an angle as the lens has in the middle: one where it
// sees at most 60 degrees away from its axis, else the sides of a cube that it sees some of.
class LensViews {
  public:
    explicit LensViews(const Intrinsics& lens); // as check_intrinsics has them

    const Intrinsics& lens() const { return lens_; }
    const std::vector<PinholeView>& views() const { return views_; }

    // Pictures of the lens as a view sees them: planes stay planes, labels are those of the nearest pixel. radial: the
    // lens's depths are from the camera, not along its axis
    DepthImages seen_by(size_t view, const DepthImages& pictures, bool radial) const;

  private:
    struct Mix {
        std::array<uint32_t, 4> pixels; // of the lens
        std::array<float, 4> shares;
        size_t nearest;
    };

    void add_view(const PinholeView& view);
    void add_cube();
    Mix mix_at(const std::array<float, 2>& position) const;
    float depth_of(const Mix& mix, const PinholeView& view, const DepthImages& pictures, bool radial) const;

    Intrinsics lens_;
    std::vector<std::array<float, 3>> rays_; // of the lens's pixels, unit; 0: it does not look there
    std::vector<PinholeView> views_;
    std::vector<std::vector<std::array<float, 2>>> positions_; // in the lens's picture, of the views' pixels; -1: none
};

} // namespace semrover
