// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/field_options.h"

#include <cstdio>
#include <fmt/format.h>
#include <string>
#include <utility>

namespace semrover {

// Text for whoever reads standard error; `fields` become options (field_options.h). Nobody has to: what a closed pipe
// or a full disk does not take is dropped, and the exit code still says what happened. (fmt::print throws there.)
template <typename... Args>
void print_stderr(fmt::format_string<Args...> format, Args&&... args)
{
    const std::string text = with_options(fmt::format(format, std::forward<Args>(args)...));
    (void)std::fwrite(text.data(), 1, text.size(), stderr);
    (void)std::fflush(stderr);
}

} // namespace semrover
