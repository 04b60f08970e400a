// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <span>
#include <string>
#include <string_view>

namespace semrover {

// text from anywhere, fit for an element or a quoted attribute of a page: markup is escaped, control characters and
// what is not UTF-8 become \xNN, and what exceeds `limit` bytes is replaced by "..."
std::string html_text(std::string_view text, size_t limit = 2000);

// a value as a page's script may hold it: ASCII, and nothing in it ends the script
std::string script_json(const Json& value);

std::string base64(std::span<const std::byte> bytes);

// 1234567 as "1,234,567"
std::string counted(uint64_t number);

} // namespace semrover
