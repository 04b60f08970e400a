// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace semrover {

// The library's messages name fields of its structs, in backquotes: "`max_bytes` allows 4 GiB". On the command line
// the same things are options: "--max-vram allows 4 GiB".
std::string option_of(std::string_view field);      // "max_bytes" -> "--max-vram"
std::string with_options(std::string_view message); // every `field` of it replaced

} // namespace semrover
