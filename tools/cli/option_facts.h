// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/base/result.h"

#include <initializer_list>
#include <span>
#include <string_view>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace CLI {
class App;
}

namespace semrover {

// What an option takes, beside what CLI11 knows of it: "kind" (number, integer, choice), "least" and "most", "words".
// Options of numbers and choices say so when they are added.
void set_option_facts(const CLI::Option& option, Json facts);

// A command as --help --json prints it: its name and help, its options with their facts, and its subcommands likewise.
Json options_json(const CLI::App& command);

// Whether the command line gives an option of this command, by its name with the dashes.
bool is_given(const CLI::App& command, std::string_view option);

// An option that does nothing with this input is a mistake of the user's. usage, where one of `options` is given:
// "--min-fill has no meaning for a .sgrid"
Status refuse_given(const CLI::App& command, std::span<const std::string_view> options, std::string_view what);
// likewise where an option of the command is given that is not in any of `meant`
Status refuse_others(const CLI::App& command, std::initializer_list<std::span<const std::string_view>> meant,
                     std::string_view what);

} // namespace semrover
