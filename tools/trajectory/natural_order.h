// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string_view>

namespace semrover {

// the order of names in which numbers count as numbers: frame2 before frame10. Names that differ in leading zeros alone
// come in the order of their bytes.
inline bool natural_less(std::string_view a, std::string_view b)
{
    const auto digit = [](char c) { return c >= '0' && c <= '9'; };
    const auto take_number = [&](std::string_view& text) {
        const size_t length = size_t(std::ranges::find_if_not(text, digit) - text.begin());
        std::string_view number = text.substr(0, length);
        text.remove_prefix(length);
        number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
        return number;
    };
    std::string_view x = a, y = b;
    while (!x.empty() && !y.empty()) {
        if (digit(x[0]) && digit(y[0])) {
            const std::string_view m = take_number(x), n = take_number(y);
            if (m != n)
                return m.size() != n.size() ? m.size() < n.size() : m < n;
        } else if (x[0] != y[0]) {
            return static_cast<unsigned char>(x[0]) < static_cast<unsigned char>(y[0]);
        } else {
            x.remove_prefix(1);
            y.remove_prefix(1);
        }
    }
    return x.empty() != y.empty() ? x.empty() : a < b;
}

} // namespace semrover
