// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/ply_colors.h"

namespace semrover {

namespace {

constexpr std::array<std::array<const char*, 3>, 3> kChannelNames = {
    {{"red", "r", "diffuse_red"}, {"green", "g", "diffuse_green"}, {"blue", "b", "diffuse_blue"}}};

ColorType color_type_of(PlyType type)
{
    if (is_float(type))
        return ColorType::real;
    return size_of(type) == 1 ? ColorType::byte : size_of(type) == 2 ? ColorType::word : ColorType::integer;
}

} // namespace

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
