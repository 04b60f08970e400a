// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace semrover {

struct SemanticClass {
    std::string_view name;
    std::array<uint8_t, 3> color; // sRGB
};

constexpr size_t kClassCount = 20;
constexpr uint8_t kNoLabel = 255; // no class is known

// the labels of a grid, by number: Cityscapes' train ids and colours (0-18), and lane markings
constexpr std::array<SemanticClass, kClassCount> kPalette = {{
    {"road", {128, 64, 128}},
    {"sidewalk", {244, 35, 232}},
    {"building", {70, 70, 70}},
    {"wall", {102, 102, 156}},
    {"fence", {190, 153, 153}},
    {"pole", {153, 153, 153}},
    {"traffic light", {250, 170, 30}},
    {"traffic sign", {220, 220, 0}},
    {"vegetation", {107, 142, 35}},
    {"terrain", {152, 251, 152}},
    {"sky", {70, 130, 180}},
    {"person", {220, 20, 60}},
    {"rider", {255, 0, 0}},
    {"car", {0, 0, 142}},
    {"truck", {0, 0, 70}},
    {"bus", {0, 60, 100}},
    {"train", {0, 80, 100}},
    {"motorcycle", {0, 0, 230}},
    {"bicycle", {119, 11, 32}},
    {"road-lane", {255, 255, 0}},
}};

// what things stand on
constexpr bool is_ground(uint8_t label)
{
    return label == 0 || label == 1 || label == 9 || label == 19; // road, sidewalk, terrain, road-lane
}

// 0..1; an unknown label gets the last class's
inline std::array<float, 3> label_color(uint32_t label)
{
    const auto& c = kPalette[label < kClassCount ? label : kClassCount - 1].color;
    return {float(c[0]) / 255, float(c[1]) / 255, float(c[2]) / 255};
}

inline std::string label_name(size_t label)
{
    return label < kClassCount ? std::string(kPalette[label].name) : "none";
}

// whether two names are the same but for case and for what lies between words: "Traffic_Sign" is "traffic sign"
bool same_class_name(std::string_view a, std::string_view b);

// number of a class by its name, none if there is no such class
std::optional<uint8_t> class_of_name(std::string_view name);

} // namespace semrover
