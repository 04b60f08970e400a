// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/deferred/latent_size.h"
#include "engine/format/depth_picture.h"

#include <compare>
#include <span>

namespace semrover {

// Keys the noise of a pixel of a latent, with seed, chain and draw.
struct NoiseKey {
    uint32_t pixel = 0, frame = 0;

    auto operator<=>(const NoiseKey&) const = default;
};

// Keeps noise on surfaces while a camera moves past them, so that what a renderer makes of it flickers less
// (docs/method.md §6.2). A pixel of the latent gets the key of the pixel of the frame before that saw the same surface:
// at the centre of its block of the picture, infinitely far away without a depth. A key goes to at most one pixel: of
// several to the nearest, of equally near ones to the first. The other pixels get new keys. So normals within a frame
// stay independent.
class NoiseTrail {
  public:
    explicit NoiseTrail(const LatentSize& size) : size_(size) {}

    // Computes the keys of the next frame. depth: [image_height, image_width]
    void follow(const CameraFrame& camera, const DepthPicture& depth);

    uint32_t frames() const { return frames_; }              // followed so far; the next one's number
    std::span<const NoiseKey> keys() const { return keys_; } // [pixels] of the last frame

  private:
    LatentSize size_;
    uint32_t frames_ = 0;
    CameraFrame camera_; // of the last frame
    std::vector<NoiseKey> keys_;
};

} // namespace semrover
