// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

constexpr double kMillimetre = 0.001;

// depth as a picture of whole numbers holds it
struct DepthPicture {
    uint32_t width = 0, height = 0;
    std::vector<uint32_t> pixels; // [height, width] units, 0: nothing
    double unit = kMillimetre;    // metres
};

// of 16 bits, of which 65535 are nothing, too
DepthPicture depth_of_gray(const ImageGray16& image, double unit);

// A PNG of 16-bit gray, or an array (number_image.h): metres in fractions (not finite, 0 or less: nothing), or whole
// numbers, as the PNG. unit: metres of one of the whole numbers. Errors: bad_input
Result<DepthPicture> read_depth_picture(const Path& path, double unit);

} // namespace semrover
