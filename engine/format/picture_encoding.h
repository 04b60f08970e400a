// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

// How the pictures of a run are written: colours as PNG or JPEG, what numbers mean never with a loss.
struct PictureEncoding {
    bool jpeg = false;         // of colours
    int quality = 92;          // of JPEG, 1 to 100
    int png_level = kPngLevel; // 0 to 9

    std::string_view color_extension() const { return jpeg ? "jpg" : "png"; }
};

// the bytes of a file of colours, [height, width, 3]
inline Result<std::vector<std::byte>> encode_color(const PictureEncoding& e, const ImageSize& size,
                                                   std::span<const uint8_t> pixels)
{
    return e.jpeg ? encode_jpeg_rgb8(size.width, size.height, pixels, e.quality)
                  : encode_png_rgb8(size.width, size.height, pixels, e.png_level);
}

} // namespace semrover
