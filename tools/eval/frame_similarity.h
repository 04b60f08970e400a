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

    SimilaritySums& operator+=(const SimilaritySums& other);
    double psnr() const; // dB, 10 log10(255^2 / mean square); infinite where all values are equal
    double ssim() const;
};

struct FrameSimilarity {
    SimilaritySums all, visible, hidden;
    std::array<SimilaritySums, kClassCount + 1> labels; // the last: of no class

    FrameSimilarity& operator+=(const FrameSimilarity& other);
};

// Structural similarity of every window that lies within two pictures of one size, [height - 10, width - 10]: of luma
// 0.299 R + 0.587 G + 0.114 B (not rounded), with a Gaussian of 11 x 11 pixels and a deviation of 1.5, K1 = 0.01,
// K2 = 0.03, L = 255. Empty where the pictures are smaller than a window.
// Source: Wang, Bovik, Sheikh and Simoncelli 2004, IEEE TIP 13(4), equation 13 with the weights of section III-B
constexpr uint32_t kSsimWindow = 11;
std::vector<double> ssim_map(const ImageRgb8& a, const ImageRgb8& b);

// of two pictures of one size. `visible` [height, width]: 128 and more is visible; `labels` [height, width]: a class or
// anything else; both may be empty.
FrameSimilarity frame_similarity(const ImageRgb8& frame, const ImageRgb8& truth, std::span<const uint8_t> visible = {},
                                 std::span<const uint8_t> labels = {});

} // namespace semrover
