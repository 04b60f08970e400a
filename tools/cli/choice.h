// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"

#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace semrover {

// an option that takes one of these words; `set` gets it
CLI::Option* add_choice(CLI::App& command, const char* name, std::vector<std::string> words, const std::string& help,
                        std::function<void(const std::string&)> set);
CLI::Option* add_choice(CLI::App& command, const char* name, std::vector<std::string> words, const std::string& help,
                        std::string& value);

// --precision: how weights and activations are stored
void add_precision_option(CLI::App& command, DType& precision);

} // namespace semrover
