// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/rasterizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

// what splat_pixels makes on the device (kernels/picture.h, engine/deferred/frame_images.h), on the host
namespace semrover {

inline uint8_t to_byte(float v)
{
    return uint8_t(std::lround(std::clamp(v, 0.f, 1.f) * 255));
}

inline std::vector<uint8_t> color_pixels(const SplatImage& image, const std::array<uint8_t, 3>& background)
{
    std::vector<uint8_t> out(image.color.size());
    for (size_t i = 0; i < image.alpha.size(); ++i)
        for (size_t c = 0; c < 3; ++c)
            out[3 * i + c] = to_byte(image.color[3 * i + c] + (1 - image.alpha[i]) * float(background[c]) / 255);
    return out;
}

// whole units, of which so many are a metre
inline std::vector<uint16_t> depth_pixels(const SplatImage& image, float units_per_metre = 1000)
{
    std::vector<uint16_t> out(image.depth_expected.size());
    for (size_t i = 0; i < out.size(); ++i) {
        const long units = std::lround(image.depth_expected[i] * units_per_metre);
        out[i] = units < 65535 ? uint16_t(units) : 0; // out of range: nothing
    }
    return out;
}

inline std::vector<uint8_t> normal_pixels(const SplatImage& image)
{
    std::vector<uint8_t> out(image.normal.size());
    for (size_t i = 0; i < image.alpha.size(); ++i) {
        const float* n = &image.normal[3 * i];
        const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (size_t c = 0; c < 3; ++c)
            out[3 * i + c] = uint8_t(std::lround(128 + (length > 0 ? 127 * n[c] / length : 0)));
    }
    return out;
}

inline std::vector<uint8_t> label_pixels(const SplatImage& image)
{
    std::vector<uint8_t> out(image.label.size());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = uint8_t(std::min<uint32_t>(image.label[i], 255));
    return out;
}

inline std::vector<uint8_t> visible_pixels(const SplatImage& image)
{
    std::vector<uint8_t> out(image.visible.size());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = image.visible[i] ? 255 : 0;
    return out;
}

} // namespace semrover
