// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace semrover {

// lines and words of camera path files in text; views into the text that they were cut from

constexpr uint64_t kMaxPathBytes = 16u << 20;

// the lines of a text one after the other, without their ends; a last line without an end counts
class TextLines {
  public:
    explicit TextLines(std::string_view text) : rest_(text) {}

    bool next(); // to the first line, and on; false at the end
    std::string_view line() const { return line_; }
    size_t number() const { return number_; } // from 1

  private:
    std::string_view rest_, line_;
    size_t number_ = 0;
};

// separated by blanks; from '#' on it is a comment. At most `most`, a word more when there are more.
std::vector<std::string_view> words_of(std::string_view line, size_t most);

// cuts `count` words off the line, or as many as there are; what is left has no blanks at its ends, and may have '#'
std::vector<std::string_view> cut_words(std::string_view& line, size_t count);

size_t count_words(std::string_view line);

// bad_input, with `where` in front, for what is not a number
Result<double> number_of(std::string_view word, std::string_view where);
Result<std::vector<double>> numbers_of_words(const std::vector<std::string_view>& words, std::string_view where);

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
