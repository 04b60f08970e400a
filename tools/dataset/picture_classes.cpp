// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/picture_classes.h"

namespace semrover {

Result<PictureClasses> PictureClasses::create(const Path& map)
{
    PictureClasses classes;
    classes.map_ = LabelMap::identity();
    if (!map.empty())
        SR_CHECK(classes.map_.apply(map));
    return classes;
}

void PictureClasses::count(const LabelImage& image)
{
    classes_.resize(kLabelNumbers, kEmpty);
    std::vector<uint64_t> here(kLabelNumbers);
    for (const uint16_t number : image.numbers)
        ++here[number];
    for (uint32_t number = 0; number < kLabelNumbers; ++number)
        if (here[number] && (map_.knows(number) || (number != kNoLabel && number != kNoNumber)))
            classes_[number] = map_(number, here[number]);
}

Status PictureClasses::check(std::string_view where) const
{
    return map_.check(where, "pixels");
}

} // namespace semrover
