// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

// a picture of one number a pixel in a .npy file: depth, class numbers
struct NpyImage {
    ImageSize size;
    bool whole = false;        // integers or bool in the file
    std::vector<float> values; // [height, width]; whole numbers are exact up to 2^24
};

// [height, width], or with an axis of 1 in front or behind; of any type that npy.h reads. What follows the array is
// not looked at, as in numpy.load. bad_input, with `where` in front; nothing is allocated that the file is too short
// to fill
Result<NpyImage> decode_npy_image(std::span<const std::byte> file, std::string_view where);

bool is_npy(std::span<const std::byte> file); // by its first bytes

// of a .npy picture or a PNG, without its pixels; bad_input
Result<ImageSize> number_image_size(const Path& path);

} // namespace semrover
