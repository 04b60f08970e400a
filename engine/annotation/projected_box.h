// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera_view.h"

namespace semrover {

// A box in some frame: its middle, its axes (x along its length, y across, z up) and its size, metres
struct PlacedBox {
    Rigid pose = kIdentity; // from the box's own frame
    std::array<double, 3> size{};
};

// an area of a picture, pixels; the picture is [0, width] x [0, height]
struct PictureBox {
    double left = 0, top = 0, right = 0, bottom = 0;

    double area() const { return (right - left) * (bottom - top); }
    bool operator==(const PictureBox&) const = default;
};

// Where a lens sees a box, as if the picture had no edges and nothing else were there.
class BoxProjection {
  public:
    // near: metres along the axis of a pinhole or opencv lens, what is nearer is cut off; other lenses have none
    BoxProjection(const Intrinsics& intrinsics, double near) : intrinsics_(intrinsics), lens_(intrinsics), near_(near)
    {
    }
    // also of a camera that moves while its picture is read out: what stands is seen in the lines that see it. What is
    // cut off, and depths(), are as at the frame's time
    BoxProjection(const CameraFrame& frame, double near) : BoxProjection(frame.intrinsics, near)
    {
        if (frame.moves())
            moving_.emplace(frame);
        to_world_ = frame.pose.camera_to_world();
    }

    // The smallest area around all that the lens shows of the box; of a pinhole exact, else to 0.02 pixels, as edges
    // are followed in steps. A panorama's is as wide as the picture where the box is on both sides of its seam. none
    // where the lens shows nothing of it. `box` is in the camera's frame at the frame's time
    std::optional<PictureBox> amodal(const PlacedBox& box) const;

    // depths, as Lens::depth has them, at which the ray through a pixel's centre enters and leaves the box; none where
    // it misses it, or meets it behind the camera alone
    std::optional<std::array<double, 2>> depths(const PlacedBox& box, uint32_t x, uint32_t y) const;

    // share of an area that lies outside the picture
    double outside(const PictureBox& box) const;
    // what of it lies inside; empty at its edge where nothing does
    PictureBox inside(const PictureBox& box) const;

  private:
    class Outline;
    std::optional<Projection> project(const Point3& point) const
    {
        return moving_ ? moving_->project(transform(to_world_, point)) : lens_.project(point);
    }

    Intrinsics intrinsics_;
    Lens lens_;
    double near_;
    std::optional<CameraView> moving_;
    Rigid to_world_ = kIdentity;
};

} // namespace semrover
