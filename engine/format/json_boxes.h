// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json_numbers.h"

#include <algorithm>

namespace semrover {

// fields of boxes in JSON; bad_input with `where` and the key in front

inline Result<std::string> text_at(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_string())
        return fail(ErrorCode::bad_input, "{}: {}: expected a string", where, key);
    return entry->get<std::string>();
}

// an array of N numbers
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

} // namespace semrover
