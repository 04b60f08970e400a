// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh_readers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <vector>

namespace semrover {

// The words of a mesh file in text, one line after another; a backslash at the end of a line joins it to the next
class WordLines {
  public:
    explicit WordLines(std::string_view text) : text_(text) {}

    bool next()
    {
        words.clear();
        if (at_ >= text_.size())
            return false;
        bool joined = true;
        while (joined && at_ < text_.size()) {
            const size_t end = std::min(text_.find('\n', at_), text_.size());
            std::string_view line = text_.substr(at_, end - at_);
            at_ = end + 1;
            ++number;
            if (line.ends_with('\r'))
                line.remove_suffix(1);
            joined = line.ends_with('\\');
            if (joined)
                line.remove_suffix(1);
            split(line);
        }
        return true;
    }

    // from word `first` on, as it stands in the line: names may hold spaces
    std::string_view rest(size_t first) const
    {
        if (first >= words.size())
            return {};
        const char* begin = words[first].data();
        return {begin, size_t(end_ - begin)};
    }

    std::vector<std::string_view> words;
    size_t number = 0; // of the last line, from 1

  private:
    // that are kept of a line: one more than the longest face has
    static constexpr size_t kMostWords = kMaxFaceCorners + 2;

    void split(std::string_view line)
    {
        constexpr std::string_view kBlank = " \t\v\f";
        for (size_t at = line.find_first_not_of(kBlank); at != std::string_view::npos && line[at] != '#';) {
            const size_t end = std::min(line.find_first_of(kBlank, at), line.size());
            if (words.size() < kMostWords)
                words.push_back(line.substr(at, end - at));
            end_ = line.data() + end;
            at = line.find_first_not_of(kBlank, end);
        }
    }

    std::string_view text_;
    size_t at_ = 0;
    const char* end_ = nullptr; // of the last word
};

// `where` is made where it is needed: an OBJ has millions of numbers
template <typename Where>
Result<double> parse_number(std::string_view word, const Where& where)
{
    const char* begin = word.data() + (word.starts_with('+') ? 1 : 0);
    double value = 0;
    const auto [end, error] = std::from_chars(begin, word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size())
        return fail(ErrorCode::bad_input, "{}: expected a number, found {}", where(), quote(word, 40));
    return value; // what is not finite is refused with the mesh
}

// finite or not; bad_input for what is no number
inline Result<double> number_of(std::string_view word, std::string_view where)
{
    return parse_number(word, [&] { return where; });
}
inline Result<double> number_of(std::string_view word, std::string_view where, size_t line)
{
    return parse_number(word, [&] { return fmt::format("{}: line {}", where, line); });
}

} // namespace semrover
