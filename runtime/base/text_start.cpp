// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/text_start.h"

#include "runtime/base/quote.h"

#include <fstream>

namespace semrover {

Result<std::string_view> text_after_mark(std::string_view bytes, std::string_view where)
{
    using namespace std::string_view_literals;
    if (bytes.starts_with("\xef\xbb\xbf"sv))
        return bytes.substr(3);
    const bool utf32 = bytes.starts_with("\xff\xfe\0\0"sv) || bytes.starts_with("\0\0\xfe\xff"sv);
    if (utf32 || bytes.starts_with("\xff\xfe"sv) || bytes.starts_with("\xfe\xff"sv))
        return fail(ErrorCode::bad_input, "{}: starts as text in UTF-{} does, expected UTF-8: save it as UTF-8", where,
                    utf32 ? 32 : 16);
    return bytes;
}

std::string beginning_of_text(const Path& path, size_t most)
{
    std::string bytes(most, '\0');
    std::ifstream file(path, std::ios::binary);
    file.read(bytes.data(), std::streamsize(bytes.size()));
    bytes.resize(size_t(file.gcount()));
    const auto text = text_after_mark(bytes, quote_path(path));
    return text ? std::string(*text) : std::string();
}

} // namespace semrover
