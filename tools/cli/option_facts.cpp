// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/option_facts.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <map>

namespace semrover {

namespace {

std::map<const CLI::Option*, Json>& facts()
{
    static std::map<const CLI::Option*, Json> all;
    return all;
}

// "text"; of another type of CLI11's, its name
std::string kind_of(const CLI::Option& option)
{
    if (option.get_items_expected_max() == 0)
        return "flag";
    std::string type = option.get_type_name();
    std::ranges::transform(type, type.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return type;
}

Json option_json(const CLI::Option& option)
{
    Json json = {{"kind", kind_of(option)},
                 {"help", option.get_description()},
                 {"required", option.get_required()},
                 {"several", option.get_items_expected_max() > 1}};
    Json names = Json::array();
    if (option.get_positional())
        names.push_back(option.get_name(true));
    for (const std::string& name : option.get_lnames())
        names.push_back("--" + name);
    for (const std::string& name : option.get_snames())
        names.push_back("-" + name);
    json["names"] = names;
    json["positional"] = option.get_positional();
    if (const auto found = facts().find(&option); found != facts().end())
        json.update(found->second);
    return json;
}

} // namespace

void set_option_facts(const CLI::Option& option, Json json)
{
    facts()[&option] = std::move(json);
}

Json options_json(const CLI::App& command)
{
    Json json = {{"name", command.get_name()}, {"help", command.get_description()}};
    Json& options = json["options"] = Json::array();
    for (const CLI::Option* option : command.get_options())
        options.push_back(option_json(*option));
    Json& commands = json["commands"] = Json::array();
    for (const CLI::App* sub : command.get_subcommands({}))
        commands.push_back(options_json(*sub));
    return json;
}

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
