// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/depth_picture.h"

#include "engine/format/number_image.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kNothing = 65535;
constexpr double kOfFractions = 1.0 / 16384; // metres; 32 bits of it are 262 km

uint32_t units_of(float metres)
{
    const double units = metres / kOfFractions;
    return units > 0 && units < 0x1p32 ? uint32_t(units + 0.5) : 0;
}

} // namespace

DepthPicture depth_of_gray(const ImageGray16& image, double unit)
{
    DepthPicture depth{image.width, image.height, {image.pixels.begin(), image.pixels.end()}, unit};
    std::ranges::replace(depth.pixels, kNothing, 0u);
    return depth;
}

Result<DepthPicture> read_depth_picture(const Path& path, double unit)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    if (!is_array(file.bytes())) {
        SR_TRY(const ImageGray16 image, read_png_gray16(path));
        return depth_of_gray(image, unit);
    }
    SR_TRY(const ArrayImage image, decode_array_image(file.bytes(), quote_path(path)));
    DepthPicture depth{image.size.width, image.size.height, {}, image.whole ? unit : kOfFractions};
    depth.pixels.reserve(image.values.size());
    for (const float value : image.values)
        depth.pixels.push_back(!image.whole                               ? units_of(value)
                               : value > 0 && uint32_t(value) != kNothing ? uint32_t(value)
                                                                          : 0);
    return depth;
}

} // namespace semrover
