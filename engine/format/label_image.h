// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

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
