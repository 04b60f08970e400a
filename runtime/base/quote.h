// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace semrover {

// Makes text of a file printable in one line of a message or a terminal: control characters and bytes that are not
// UTF-8 become \xNN, and what exceeds `limit` bytes becomes "...".
std::string printable(std::string_view text, size_t limit = 200);

// the same between single quotes
std::string quote(std::string_view text, size_t limit = 200);
std::string quote_path(const std::filesystem::path& path); // never shortened below PATH_MAX

} // namespace semrover
