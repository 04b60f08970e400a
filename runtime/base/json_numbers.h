// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <array>
#include <cmath>
#include <optional>
#include <vector>

namespace semrover {

// numbers of scene files (camera paths, rigs); bad_input with `where` and the key in front

inline Result<double> finite_number(const Json& value, std::string_view where)
{
    if (!value.is_number())
        return fail(ErrorCode::bad_input, "{}: expected a number, found {}", where, value.type_name());
    return value.get<double>(); // JSON has no NaN, and the reader refuses what overflows
}

// none when the object has no such key
inline Result<std::optional<double>> optional_number(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end())
        return std::optional<double>();
    SR_TRY(const double value, finite_number(*entry, fmt::format("{}: {}", where, key)));
    return std::optional<double>(value);
}

// N numbers under a key
template <size_t N>
Result<std::array<double, N>> numbers_at(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_array() || entry->size() != N)
        return fail(ErrorCode::bad_input, "{}: {}: expected an array of {} numbers", where, key, N);
    std::array<double, N> numbers{};
    for (size_t i = 0; i < N; ++i) {
        SR_TRY(numbers[i], finite_number((*entry)[i], fmt::format("{}: {}", where, key)));
    }
    return numbers;
}

// an array of numbers, or of arrays of numbers, in the order of the text
inline Result<std::vector<double>> numbers_of(const Json& value, std::string_view where)
{
    if (!value.is_array())
        return fail(ErrorCode::bad_input, "{}: expected an array of numbers, found {}", where, value.type_name());
    std::vector<double> numbers;
    for (const Json& item : value) {
        if (item.is_array()) {
            for (const Json& inner : item) {
                SR_TRY(const double number, finite_number(inner, where));
                numbers.push_back(number);
            }
        } else {
            SR_TRY(const double number, finite_number(item, where));
            numbers.push_back(number);
        }
    }
    return numbers;
}

// image sizes may be written as 616.0
inline Result<uint32_t> image_side(double value, std::string_view where)
{
    if (!(value >= 1 && value <= 16384) || value != std::floor(value))
        return fail(ErrorCode::bad_input, "{}: expected an image size of 1 to 16384 pixels, found {}", where, value);
    return static_cast<uint32_t>(value);
}

} // namespace semrover
