// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/file_colors.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kWhiteOfWords = 65535, kBytesPerWord = 257; // 255 * 257 = 65535
constexpr double kOverOne = 1e-3;                            // what rounding and resampling leave above white
constexpr double kHardlySeen = 8;                            // of 255

constexpr std::array<std::array<const char*, 3>, 3> kChannelNames = {
    {{"red", "r", "diffuse_red"}, {"green", "g", "diffuse_green"}, {"blue", "b", "diffuse_blue"}}};

ColorType color_type_of(PlyType type)
{
    if (is_float(type))
        return ColorType::real;
    return size_of(type) == 1 ? ColorType::byte : size_of(type) == 2 ? ColorType::word : ColorType::integer;
}

} // namespace

void ColorScale::see(double value, size_t row)
{
    if (!std::isfinite(value) && !odd_row_)
        odd_row_ = row;
    least_ = std::min(least_, value);
    most_ = std::max(most_, value);
}

Status ColorScale::decide(std::string_view where, std::vector<std::string>& warnings)
{
    if (odd_row_)
        return fail(ErrorCode::bad_input, "{}: row {} has a colour that is not finite", where, *odd_row_);
    if (least_ < (type_ == ColorType::real ? -kOverOne : 0))
        return fail(ErrorCode::bad_input, "{}: the colour {}, expected 0 or more", where, least_);
    const bool real = type_ == ColorType::real, wide = type_ == ColorType::word || type_ == ColorType::integer;
    if (most_ > (wide ? kWhiteOfWords : 255))
        return fail(ErrorCode::bad_input, "{}: the colour {}, expected 0 to {}", where, most_,
                    real   ? "1, or 0 to 255"
                    : wide ? "255, or 0 to 65535"
                           : "255");
    if (real)
        factor_ = most_ <= 1 + kOverOne ? 255 : 1;
    else
        factor_ = most_ > 255 ? 1 / kBytesPerWord : 1;
    const char* other = type_ == ColorType::word && most_ > 0 && factor_ == 1 ? "65535"
                        : real && factor_ == 1 && most_ < kHardlySeen         ? "1"
                                                                              : nullptr;
    if (other)
        warnings.push_back(fmt::format("{}: its colours are at most {}: they are taken for 0 to 255, not 0 to {}",
                                       where, most_, other));
    return {};
}

double ColorScale::level_of(double value) const
{
    return std::clamp(value * factor_, 0.0, 255.0);
}

uint8_t ColorScale::byte_of(double value) const
{
    return static_cast<uint8_t>(std::lround(level_of(value)));
}

Result<std::optional<PlyColors>> PlyColors::find(const PlyElement& element, std::string_view where,
                                                 std::vector<std::string>& warnings)
{
    Channels channels{};
    ColorType type = ColorType::byte;
    for (size_t c = 0; c < 3; ++c) {
        for (const char* name : kChannelNames[c])
            if (const PlyProperty* property = element.find(name); property && !property->is_list && !channels[c])
                channels[c] = property;
        if (!channels[c])
            return std::optional<PlyColors>();
        type = std::max(type, color_type_of(channels[c]->values.type()));
    }
    ColorScale scale(type);
    for (size_t row = 0; row < element.rows; ++row)
        for (const PlyProperty* channel : channels)
            scale.see(channel->values[row], row);
    SR_CHECK(scale.decide(where, warnings));
    return std::optional<PlyColors>(PlyColors(channels, scale));
}

std::array<uint8_t, 3> PlyColors::bytes(size_t row) const
{
    std::array<uint8_t, 3> color{};
    for (size_t c = 0; c < 3; ++c)
        color[c] = scale_.byte_of(channels_[c]->values[row]);
    return color;
}

std::array<double, 3> PlyColors::fractions(size_t row) const
{
    std::array<double, 3> color{};
    for (size_t c = 0; c < 3; ++c)
        color[c] = scale_.level_of(channels_[c]->values[row]) / 255;
    return color;
}

} // namespace semrover
