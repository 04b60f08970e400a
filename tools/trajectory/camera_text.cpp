// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trajectory/camera_text.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>

namespace semrover {

namespace {

constexpr std::string_view kBlanks = " \t\r";

// cuts the next word off the line; empty at its end or at a comment
std::string_view take_word(std::string_view& line)
{
    const size_t begin = line.find_first_not_of(kBlanks);
    line.remove_prefix(std::min(begin, line.size()));
    std::string_view word = line.substr(0, line.find_first_of(kBlanks));
    word = word.substr(0, word.find('#'));
    line.remove_prefix(word.size());
    return word;
}

} // namespace

bool TextLines::next()
{
    if (rest_.empty())
        return false;
    const size_t length = rest_.find('\n');
    line_ = rest_.substr(0, length);
    rest_.remove_prefix(length == std::string_view::npos ? rest_.size() : length + 1);
    ++number_;
    return true;
}

std::vector<std::string_view> words_of(std::string_view line, size_t most)
{
    std::vector<std::string_view> words;
    while (words.size() <= most) {
        const std::string_view word = take_word(line);
        if (word.empty())
            break;
        words.push_back(word);
    }
    return words;
}

std::vector<std::string_view> cut_words(std::string_view& line, size_t count)
{
    std::vector<std::string_view> words;
    while (words.size() < count) {
        const std::string_view word = take_word(line);
        if (word.empty())
            break;
        words.push_back(word);
    }
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    line.remove_suffix(line.size() - std::min(line.find_last_not_of(kBlanks) + 1, line.size()));
    return words;
}

size_t count_words(std::string_view line)
{
    size_t count = 0;
    while (!take_word(line).empty())
        ++count;
    return count;
}

Result<double> number_of(std::string_view word, std::string_view where)
{
    double value = 0;
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc::result_out_of_range &&
        std::abs(value = std::strtod(std::string(digits).c_str(), nullptr)) < 1)
        error = {}; // too small for a double
    if (error != std::errc() || end != digits.data() + digits.size())
        return fail(ErrorCode::bad_input, "{}: expected a number, found {}", where, quote(word, 40));
    return value;
}

Result<std::vector<double>> numbers_of_words(const std::vector<std::string_view>& words, std::string_view where)
{
    std::vector<double> numbers;
    for (const std::string_view word : words) {
        SR_TRY(const double value, number_of(word, where));
        numbers.push_back(value);
    }
    return numbers;
}

} // namespace semrover
