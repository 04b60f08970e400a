// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/lens.h"

namespace semrover {

// Where one camera saw what another sees
class Reprojection {
  public:
    Reprojection(const CameraFrame& from, const CameraFrame& to);

    // the surface at a position (x, y) of the picture of `to`, `depth` metres away (> 0), as `from` saw it; none where
    // one of the lenses does not look
    std::optional<Projection> source(double x, double y, double depth) const;

  private:
    Lens from_, to_;
    Rigid move_; // from the frame of `to` to that of `from`
};

} // namespace semrover
