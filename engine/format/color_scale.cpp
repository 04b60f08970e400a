// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/color_scale.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kWhiteOfWords = 65535, kBytesPerWord = 257; // 255 * 257 = 65535
constexpr double kOverOne = 1e-3;                            // what rounding and resampling leave above white
constexpr double kHardlySeen = 8;                            // of 255

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

} // namespace semrover
