// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

// a picture of one number a pixel as an array in a file: depth, class numbers
struct ArrayImage {
    ImageSize size;
    bool whole = false;        // integers or bool in the file
    std::vector<float> values; // [height, width]; whole numbers are exact up to 2^24
};

// Of a .npy [height, width], or with an axis of 1 in front or behind, of any type that npy.h reads; what follows the
// array is not looked at, as in numpy.load. Of a depth map of COLMAP's dense reconstruction, fp32.
// source: COLMAP's scripts/python/read_write_dense.py. bad_input, with `where` in front; nothing is allocated that the
// file is too short to fill
Result<ArrayImage> decode_array_image(std::span<const std::byte> file, std::string_view where);

bool is_array(std::span<const std::byte> file); // either, by its first bytes

// of an array or a PNG, without its pixels; bad_input
Result<ImageSize> number_image_size(const Path& path);

constexpr uint16_t kNoNumber = 65535; // no class is given
constexpr size_t kLabelNumbers = 65536;

// class numbers of a picture, whoever's they are
struct LabelImage {
    ImageSize size;
    std::vector<uint16_t> numbers; // [height, width]
};

// of a PNG; kNoNumber where alpha is 0
std::vector<uint16_t> label_numbers(PngNumbers image);

// The one reader of pictures that hold class numbers: of a PNG the gray value (1 to 16 bits, not scaled), the index of
// a palette's colour, not the colour, or the gray of three equal channels; nothing where alpha is 0.
// Of a .npy [height, width] of whole numbers the number; -1 is nothing. Errors: bad_input, also for pictures in colour
// and JPEGs, whose compression changes numbers
Result<LabelImage> read_label_image(const Path& path);

} // namespace semrover
