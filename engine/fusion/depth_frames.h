// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/image.h"

#include <functional>

namespace semrover {

// pictures of one frame, [height, width], top row first
struct DepthImages {
    std::vector<float> depth;    // metres along the optical axis; 0: nothing
    std::vector<uint8_t> labels; // class or kNoLabel; empty: no labels
    std::vector<uint8_t> colors; // [.., 3] sRGB; empty: gray
};

// The input of fusion: cameras, and a function that loads a frame's pictures. It is called more than once for a frame.
struct DepthFrames {
    std::vector<CameraFrame> cameras;
    std::function<Result<DepthImages>(size_t)> load;
};

// Pictures of one view with another number of pixels: edges fall on edges.

// what lies at the centre of each new pixel
template <typename T>
std::vector<T> nearest_pixels(const std::vector<T>& pixels, ImageSize from, ImageSize to)
{
    std::vector<T> out;
    out.reserve(size_t(to.width) * to.height);
    for (uint32_t y = 0; y < to.height; ++y)
        for (uint32_t x = 0; x < to.width; ++x) {
            const uint64_t row = (2 * uint64_t(y) + 1) * from.height / (2 * uint64_t(to.height));
            const uint64_t column = (2 * uint64_t(x) + 1) * from.width / (2 * uint64_t(to.width));
            out.push_back(pixels[row * from.width + column]);
        }
    return out;
}

// the mean, in linear light, of the pixels whose centres each new pixel covers; where there are none, the nearest
ImageRgb8 resampled(const ImageRgb8& image, ImageSize to);

// whether one is a scaled version of the other: their proportions differ by 2 % at most
bool same_view(ImageSize a, ImageSize b);

} // namespace semrover
