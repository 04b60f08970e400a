// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/choice.h"

#include <CLI/CLI.hpp>

namespace semrover {

void add_choice(CLI::App& c, const char* name, std::vector<std::string> words, const char* help,
                std::function<void(const std::string&)> set)
{
    c.add_option_function<std::string>(name, std::move(set), help)->check(CLI::IsMember(std::move(words)));
}

void add_precision_option(CLI::App& c, DType& precision)
{
    add_choice(c, "--precision", {"fp16", "fp32"}, "storage of weights and activations",
               [&precision](const std::string& text) { precision = text == "fp32" ? DType::f32 : DType::f16; });
}

} // namespace semrover
