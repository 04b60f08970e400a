// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/image.h"
#include "engine/refine/latent_size.h"

#include <compare>
#include <span>

namespace semrover {

// what decides the noise on a pixel of a latent, beside seed, chain and draw
struct NoiseKey {
    uint32_t pixel = 0, frame = 0;

    auto operator<=>(const NoiseKey&) const = default;
};

// Noise that stays on surfaces while a camera drives past them, so that what a renderer makes of it stays, too. A pixel
// of the latent takes the key of that pixel of the frame before where its surface (at the centre of its block of the
// picture; infinitely far away without a depth) was seen. Every key goes to one pixel at most, of several to the
// nearest (of equally near ones the first), and what is left gets new ones: within a frame normals stay independent.
// After Chang et al., How I Warped Your Noise (ICLR 2024) and Burgert et al., Go-with-the-Flow (arXiv 2501.08331), who
// blend the noise of several pixels.
class NoiseTrail {
  public:
    explicit NoiseTrail(const LatentSize& size) : size_(size) {}

    // the next frame; depth: [image_height, image_width] millimetres as `render` writes it, 0 and 65535: nothing
    void follow(const CameraFrame& camera, const ImageGray16& depth);

    uint32_t frames() const { return frames_; }              // followed so far; the next one's number
    std::span<const NoiseKey> keys() const { return keys_; } // [pixels] of the last frame

  private:
    LatentSize size_;
    uint32_t frames_ = 0;
    CameraFrame camera_; // of the last frame
    std::vector<NoiseKey> keys_;
};

} // namespace semrover
