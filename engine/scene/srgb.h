// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>

namespace semrover {

// IEC 61966-2-1, 0..1
inline double linear_of_srgb(double v)
{
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}
inline double srgb_of_linear(double v)
{
    return v <= 0.0031308 ? v * 12.92 : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
}

// of bytes
inline const std::array<double, 256> kLinear = [] {
    std::array<double, 256> table{};
    for (size_t i = 0; i < table.size(); ++i)
        table[i] = linear_of_srgb(double(i) / 255);
    return table;
}();

} // namespace semrover
