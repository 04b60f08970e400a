// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace semrover {

// What an option takes, beside what CLI11 knows of it: "kind" (number, integer, choice), "least" and "most", "words".
// Options of numbers and choices say so when they are added.
void set_option_facts(const CLI::Option& option, Json facts);

// A command as --help --json prints it: its name and help, its options with their facts, and its subcommands likewise.
Json options_json(const CLI::App& command);

} // namespace semrover
