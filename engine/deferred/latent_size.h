// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/tensor.h"

#include <cstdint>

namespace semrover {

// Sizes of a picture and its latent, whose pixels are blocks of downscale x downscale. A picture that does not fill its
// last blocks is padded by repeating its last column and row, and cropped after decoding.
struct LatentSize {
    uint32_t image_width = 0, image_height = 0; // pixels
    uint32_t downscale = 8;

    uint32_t width() const { return divide_up(image_width, downscale); }
    uint32_t height() const { return divide_up(image_height, downscale); }
    uint32_t pixels() const { return width() * height(); }
    bool operator==(const LatentSize&) const = default;
};

} // namespace semrover
