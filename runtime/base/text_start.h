// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <string_view>

namespace semrover {

// The text of a file without the byte order mark that editors of Windows and .NET write in front of UTF-8. Every
// reader of text comes through here: read_text_file does, what maps a file calls it. bad_input, with `where` in front,
// for UTF-16 and UTF-32.
Result<std::string_view> text_after_mark(std::string_view bytes, std::string_view where);

// the same of the first `most` bytes, to tell what a file is; empty for what cannot be read or is no UTF-8
std::string beginning_of_text(const Path& path, size_t most);

} // namespace semrover
