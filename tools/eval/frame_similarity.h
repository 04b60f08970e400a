// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/scene/palette.h"

#include <array>

namespace semrover {

// how alike two pictures are over some of their pixels: sums, so that frames can be pooled
struct SimilaritySums {
    uint64_t pixels = 0;
    double squares = 0;   // of differences of 8-bit sRGB values, over three channels
    uint64_t windows = 0; // of SSIM, with their middle on such a pixel
    double similarity = 0;
    double gradients = 0, true_gradients = 0; // squares of luma's, by Sobel, of pixels that are not on the rim

    SimilaritySums& operator+=(const SimilaritySums& other);
    double psnr() const; // dB, 10 log10(255^2 / mean square); infinite where all values are equal
    double ssim() const;
    // Tenengrad of the frame as a share of the truth's: below 1 what is blurred, above 1 noise or edges that are too
    // many. Source: Krotkov 1988, IJCV 1(3), equation 7. NaN where the truth has none
    double sharpness() const;
};

constexpr std::array kDistances{6.0, 12.0, 25.0}; // metres, where a range of distances ends; the last has no end

struct FrameSimilarity {
    using Classes = std::array<SimilaritySums, kClassCount + 1>; // the last: of no class

    SimilaritySums all, visible, hidden;
    Classes labels;
    std::array<Classes, kDistances.size() + 1> distances; // of pixels with a depth

    FrameSimilarity& operator+=(const FrameSimilarity& other);
};

// Structural similarity of every window that lies within two pictures of one size, [height - 10, width - 10]: of luma
// 0.299 R + 0.587 G + 0.114 B (not rounded), with a Gaussian of 11 x 11 pixels and a deviation of 1.5, K1 = 0.01,
// K2 = 0.03, L = 255. Empty where the pictures are smaller than a window.
// Source: Wang, Bovik, Sheikh and Simoncelli 2004, IEEE TIP 13(4), equation 13 with the weights of section III-B
constexpr uint32_t kSsimWindow = 11;
std::vector<double> ssim_map(const ImageRgb8& a, const ImageRgb8& b);

// what is known of pixels, each [height, width] or empty
struct KnownPixels {
    std::vector<uint8_t> visible; // 128 and more is visible
    std::vector<uint8_t> labels;  // a class or anything else
    std::vector<float> depth;     // metres; 0: nothing
};

// of two pictures of one size
FrameSimilarity frame_similarity(const ImageRgb8& frame, const ImageRgb8& truth, const KnownPixels& known = {});

} // namespace semrover
