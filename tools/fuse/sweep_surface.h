// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/dataset/lidar_sweeps.h"
#include "tools/fuse/lens_views.h"

#include <optional>
#include <span>

namespace semrover {

// The surface that a sweep of a lidar shows. Its returns are put into columns of 0.4 degrees, where they lie one above
// the other; nothing need be known of its beams. Between two that follow each other there is surface if they belong
// together: ranges are alike, or both lie on the ground, whose returns are far apart.
class SweepSurface {
  public:
    explicit SweepSurface(std::span<const ScanPoint> points);

    struct Hit {
        float across;  // metres from the lidar's axis
        float azimuth; // of the returns that it lies between, radians to the left of x
        uint8_t label;
    };
    // where a ray meets it; azimuth: radians to the left of x; slope: metres up a metre across
    std::optional<Hit> along(float azimuth, float slope) const;

  private:
    struct Return {
        float azimuth, slope, across;
        uint8_t label;
        float height() const { return slope * across; }
    };

    static bool belong_together(const Return& a, const Return& b);
    std::optional<Hit> in_column(size_t column, float slope) const;

    std::vector<std::vector<Return>> columns_; // by rising slope
};

// The four sides of a box around a lidar, as pinholes of its axes (x forward, y left, z up) that see all slopes between
// these
std::vector<PinholeView> sweep_views(double lowest_slope, double highest_slope);

// depth and labels of what one of these sees
DepthImages seen_by(const PinholeView& view, const SweepSurface& surface);

} // namespace semrover
