// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"

#include <cstdio>
#include <fmt/format.h>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace semrover {

// The library's messages name fields of its structs, in backquotes: "`max_bytes` allows 4 GiB". On the command line
// the same things are options: "--max-vram allows 4 GiB".
std::string option_of(std::string_view field);      // "max_bytes" -> "--max-vram"
std::string with_options(std::string_view message); // every `field` of it replaced

// Text for whoever reads standard error; `fields` become options. Nobody has to: what a closed pipe
// or a full disk does not take is dropped, and the exit code still says what happened. (fmt::print throws there.)
template <typename... Args>
void print_stderr(fmt::format_string<Args...> format, Args&&... args)
{
    const std::string text = with_options(fmt::format(format, std::forward<Args>(args)...));
    (void)std::fwrite(text.data(), 1, text.size(), stderr);
    (void)std::fflush(stderr);
}

// on stderr, one a line; with --quiet nothing
void print_warnings(const std::vector<std::string>& warnings, const Globals& globals);

} // namespace semrover
