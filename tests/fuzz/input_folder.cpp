// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/fuzz_target.h"

#include <cstdio>
#include <cstdlib>

namespace semrover::fuzz {

void found(std::string_view what)
{
    std::fprintf(stderr, "found: %.*s\n", int(what.size()), what.data());
    std::abort();
}

void check_error(const Error& error)
{
    if (error.code != ErrorCode::bad_input)
        found(fmt::format("code {} instead of bad_input: {}", int(error.code), error.message));
    if (error.message.empty() || error.message.find('\n') != std::string::npos)
        found("the message is not a line: " + error.message);
    if (error.message.size() > 64 << 10)
        found(fmt::format("a message of {} bytes", error.message.size()));
}

InputFolder::InputFolder(Bytes input, std::string_view first)
{
    const std::string_view text = text_of(input);
    const auto mark_from = [&](size_t at) {
        while ((at = text.find(kFileMark, at)) != std::string_view::npos && at > 0 && text[at - 1] != '\n')
            ++at;
        return at;
    };
    size_t mark = mark_from(0);
    if (mark != 0)
        add(first, input.first(std::min(mark, input.size())));
    while (mark != std::string_view::npos) {
        const size_t begin = mark + kFileMark.size(), end = std::min(text.find('\n', begin), text.size());
        const size_t body = std::min(end + 1, text.size());
        mark = mark_from(body);
        // the end of the line before a mark is the mark's
        const size_t stop = mark == std::string_view::npos ? text.size() : std::max(body, mark - 1);
        add(text.substr(begin, end - begin), input.subspan(body, stop - body));
    }
}

void InputFolder::add(std::string_view name, Bytes bytes)
{
    if (name.find('\0') == std::string_view::npos && folder_.add(name, bytes))
        names_.emplace_back(name);
    else if (names_.empty() && folder_.add("file", bytes))
        names_.emplace_back("file");
}

} // namespace semrover::fuzz
