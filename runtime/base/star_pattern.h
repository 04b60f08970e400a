// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

namespace semrover {

// '*' stands for any text; take_one(pattern, c) takes what stands for one byte off the pattern's front and says whether
// it stands for `c`. Greedy with one point to come back to, so that it takes no more than size times size.
template <typename TakeOne>
bool matches_stars(std::string_view pattern, std::string_view text, const TakeOne& take_one)
{
    std::optional<std::string_view> after_star;
    std::string_view from;
    while (!text.empty()) {
        if (pattern.starts_with('*')) {
            pattern.remove_prefix(1);
            after_star = pattern;
            from = text;
            continue;
        }
        if (!pattern.empty() && take_one(pattern, text[0])) {
            text.remove_prefix(1);
            continue;
        }
        if (!after_star)
            return false;
        pattern = *after_star;
        from.remove_prefix(1);
        text = from;
    }
    return pattern.find_first_not_of('*') == pattern.npos;
}

} // namespace semrover
