// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/flow_picture.h"
#include "engine/format/image.h"

#include <optional>

namespace semrover {

// depth in whole units of 16 bits, or float32 metres
enum class DepthFormat : uint8_t { mm, cm, kitti256, npy };
constexpr const char* kDepthFormats[] = {"mm", "cm", "kitti256", "npy"};
constexpr double units_per_metre(DepthFormat format) // 0: of none
{
    constexpr double kUnits[] = {1000, 100, 256, 0};
    return kUnits[size_t(format)];
}

// How the pictures of a run are written: colours as PNG or JPEG, others without a loss.
struct PictureEncoding {
    bool jpeg = false;         // of colours
    int quality = 92;          // of JPEG, 1 to 100
    int png_level = kPngLevel; // 0 to 9
    DepthFormat depth = DepthFormat::mm;
    std::optional<FlowFormat> flow = {}; // none: no flow

    std::string_view color_extension() const { return jpeg ? "jpg" : "png"; }
    std::string_view depth_extension() const { return depth == DepthFormat::npy ? "npy" : "png"; }
    // metres of what depth pictures hold
    double depth_unit() const { return depth == DepthFormat::npy ? 1 : 1 / units_per_metre(depth); }
};

// the bytes of a file of colours, [height, width, 3]
inline Result<std::vector<std::byte>> encode_color(const PictureEncoding& e, const ImageSize& size,
                                                   std::span<const uint8_t> pixels)
{
    return e.jpeg ? encode_jpeg_rgb8(size.width, size.height, pixels, e.quality)
                  : encode_png_rgb8(size.width, size.height, pixels, e.png_level);
}

} // namespace semrover
