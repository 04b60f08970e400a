// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/option_meaning.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

bool is_given(const CLI::App& command, std::string_view name)
{
    const CLI::Option* option = command.get_option_no_throw(std::string(name));
    return option && option->count() > 0;
}

Status refuse_given(const CLI::App& command, std::span<const std::string_view> options, std::string_view what)
{
    for (const std::string_view name : options)
        if (is_given(command, name))
            return fail(ErrorCode::usage, "{} has no meaning for {}", name, what);
    return {};
}

Status refuse_others(const CLI::App& command, std::initializer_list<std::span<const std::string_view>> meant,
                     std::string_view what)
{
    for (const CLI::Option* option : command.get_options()) {
        if (option->get_positional() || option->count() == 0)
            continue;
        const std::string name = option->get_name();
        const auto is_meant = [&](std::span<const std::string_view> names) {
            return std::ranges::any_of(names, [&](std::string_view n) { return option->check_name(std::string(n)); });
        };
        if (std::ranges::none_of(meant.begin(), meant.end(), is_meant))
            return fail(ErrorCode::usage, "{} has no meaning for {}", name, what);
    }
    return {};
}

} // namespace semrover
