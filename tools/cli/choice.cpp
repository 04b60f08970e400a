// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/choice.h"

#include "tools/cli/option_facts.h"

#include <CLI/CLI.hpp>

namespace semrover {

CLI::Option* add_choice(CLI::App& c, const char* name, std::vector<std::string> words, const std::string& help,
                        std::function<void(const std::string&)> set)
{
    CLI::Option* option = c.add_option_function<std::string>(name, std::move(set), help);
    set_option_facts(*option, {{"kind", "choice"}, {"words", words}});
    return option->check(CLI::IsMember(std::move(words)));
}

CLI::Option* add_choice(CLI::App& c, const char* name, std::vector<std::string> words, const std::string& help,
                        std::string& value)
{
    return add_choice(c, name, std::move(words), help, [&value](const std::string& word) { value = word; });
}

void add_precision_option(CLI::App& c, DType& precision)
{
    add_choice(c, "--precision", {"fp16", "fp32"}, "storage of weights and activations",
               [&precision](const std::string& text) { precision = text == "fp32" ? DType::f32 : DType::f16; });
}

} // namespace semrover
