// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/quote.h"

#include <cstdint>
#include <fmt/format.h>
#include <iterator>

namespace semrover {

namespace {

// bytes of the well-formed UTF-8 sequence at the start of text, 0 if there is none; RFC 3629: no overlong forms, no
// surrogates, nothing above U+10FFFF
size_t utf8_length(std::string_view text)
{
    const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
    const uint8_t lead = byte(0);
    if (lead < 0x80)
        return 1;
    const size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
    if (lead < 0xc2 || lead > 0xf4 || text.size() < length)
        return 0;
    for (size_t i = 1; i < length; ++i)
        if ((byte(i) & 0xc0) != 0x80)
            return 0;
    const uint8_t second = byte(1);
    if ((lead == 0xe0 && second < 0xa0) || (lead == 0xed && second > 0x9f) || (lead == 0xf0 && second < 0x90) ||
        (lead == 0xf4 && second > 0x8f))
        return 0;
    return length;
}

// C0, DEL and C1: a terminal may act on them
bool is_control(std::string_view sequence)
{
    const auto first = static_cast<uint8_t>(sequence[0]);
    if (sequence.size() == 1)
        return first < 0x20 || first == 0x7f;
    return first == 0xc2 && static_cast<uint8_t>(sequence[1]) < 0xa0;
}

} // namespace

std::string printable(std::string_view text, size_t limit)
{
    std::string out;
    for (size_t i = 0; i < text.size();) {
        const size_t length = utf8_length(text.substr(i));
        if (out.size() + (length ? length : 4) > limit) {
            out += "...";
            break;
        }
        const std::string_view sequence = text.substr(i, length ? length : 1);
        if (length == 0 || is_control(sequence)) {
            for (const char c : sequence)
                fmt::format_to(std::back_inserter(out), "\\x{:02x}", static_cast<uint8_t>(c));
        } else {
            out += sequence;
        }
        i += sequence.size();
    }
    return out;
}

std::string quote(std::string_view text, size_t limit)
{
    return fmt::format("'{}'", printable(text, limit));
}

std::string quote_path(const std::filesystem::path& path)
{
    return quote(path.string(), 4096);
}

} // namespace semrover
