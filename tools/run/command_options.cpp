// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/command_options.h"

#include "runtime/base/quote.h"
#include "runtime/system/process.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/value_options.h"

#include <array>
#include <CLI/CLI.hpp>
#include <span>

namespace semrover {

namespace {

constexpr const char* kScenesProgram = "semrover-scenes";

// the commands that tasks are of
void add_task_commands(CLI::App& app, const Globals& globals, Run& run)
{
    add_generate(app, globals, run);
    add_render(app, globals, run);
    add_refine(app, globals, run);
}

Result<system::Process> start_scenes(std::vector<std::string> arguments, system::Process::Pipe pipe)
{
    const Path file = system::own_program().replace_filename(kScenesProgram);
    arguments.insert(arguments.begin(), "semrover");
    auto child = system::Process::start(file, arguments, pipe);
    if (!child)
        return fail(ErrorCode::bad_input,
                    "{} cannot be started ({}): cmake --build --preset release --target programs "
                    "builds it",
                    quote_path(file), system::message_of(child.error()));
    return std::move(*child);
}

Status wait_for(system::Process& child)
{
    const int code = child.wait();
    if (code == 0)
        return {};
    if (code > 128)
        return fail(ErrorCode::interrupted, "{} was ended by signal {}", kScenesProgram, code - 128);
    return fail(ErrorCode(code), "{} ended with code {}", kScenesProgram, code);
}

Result<Json> facts_of_neighbour(const char* command)
{
    SR_TRY(system::Process child, start_scenes({command, "--help", "--json"}, system::Process::Pipe::output));
    std::string text;
    std::array<char, 4096> bytes;
    for (;;) {
        const auto n = child.pipe.read(std::as_writable_bytes(std::span(bytes)));
        if (!n || *n == 0)
            break;
        text.append(bytes.data(), *n);
    }
    SR_CHECK(wait_for(child));
    return parse_json(text, kScenesProgram);
}

Result<Json> facts_of(const char* command)
{
    // note: facts are known by the options' addresses, so that they stay
    static const Globals globals;
    static Run run;
    static CLI::App app;
    if (app.get_subcommands({}).empty())
        add_task_commands(app, globals, run);
    for (const CLI::App* own : app.get_subcommands({}))
        if (own->get_name() == command)
            return options_json(*own);
    return facts_of_neighbour(command);
}

std::string range_text(const Json& facts)
{
    if (!facts.contains("least"))
        return "";
    return fmt::format(" from {} to {}", json_text(facts["least"]), json_text(facts["most"]));
}

bool in_range(const Json& facts, const std::string& text)
{
    const double value = std::strtod(text.c_str(), nullptr);
    return !facts.contains("least") || (value >= facts["least"].get<double>() && value <= facts["most"].get<double>());
}

std::string found_text(const JobValue& value)
{
    return value.is_single() ? quote(value.text) : std::string(kind_name(value.kind));
}

} // namespace

Result<CommandOptions> CommandOptions::create(const char* command, std::vector<std::string> taken)
{
    CommandOptions c;
    SR_TRY(const Json facts, facts_of(command));
    taken.insert(taken.end(), {"help", "profile", "dry-run"});
    for (const Json& option : facts.value("options", Json::array()))
        for (const Json& name : option.value("names", Json::array())) {
            const std::string text = name.get<std::string>();
            if (text.starts_with("--") && !std::ranges::count(taken, text.substr(2)))
                c.options_[text.substr(2)] = option;
        }
    return c;
}

const Json* CommandOptions::find(std::string_view key) const
{
    std::string name(key);
    std::ranges::replace(name, '_', '-');
    const auto found = options_.find(name);
    return found == options_.end() ? nullptr : &found->second;
}

std::vector<std::string> CommandOptions::keys() const
{
    std::vector<std::string> keys;
    for (const auto& [name, facts] : options_) {
        keys.push_back(name);
        std::ranges::replace(keys.back(), '-', '_');
    }
    return keys;
}

Result<std::optional<JobOption>> CommandOptions::option(const Json& facts, std::string_view key,
                                                        const JobValue& value) const
{
    using Kind = JobValue::Kind;
    std::string name = "--" + std::string(key);
    std::ranges::replace(name, '_', '-');
    const std::string kind = facts.value("kind", "text");
    const auto refuse = [&](const std::string& expected) {
        return fail(ErrorCode::bad_input, "{}: expected {}, found {}", quote(key), expected, found_text(value));
    };
    if (kind == "flag") {
        if (value.kind != Kind::boolean)
            return refuse("true or false");
        return value.text == "true" ? std::optional(JobOption(name, "")) : std::nullopt;
    }
    if (kind == "integer" || kind == "number") {
        const bool fits = value.kind == Kind::integer || (value.kind == Kind::number && kind == "number");
        if (!fits || !in_range(facts, value.text))
            return refuse((kind == "integer" ? "an integer" : "a number") + range_text(facts));
        return JobOption(name, value.text);
    }
    if (kind == "choice") {
        const auto words = facts.value("words", std::vector<std::string>());
        if (value.kind != Kind::text || !std::ranges::count(words, value.text))
            return refuse(fmt::format("{}", fmt::join(words, ", ")));
        return JobOption(name, value.text);
    }
    if (value.kind == Kind::list) { // as --origin X,Y,Z
        std::string joined;
        for (const JobValue& item : value.items) {
            if (!item.is_single())
                return refuse("a list of numbers or texts");
            joined += (joined.empty() ? "" : ",") + item.text;
        }
        return JobOption(name, joined);
    }
    if (!value.is_single() || value.kind == Kind::boolean || value.text.empty())
        return refuse("a text");
    return JobOption(name, value.text);
}

namespace {

Status parse(CLI::App& app, const std::vector<std::string>& arguments)
{
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    try {
        app.parse(reversed);
    } catch (const CLI::ParseError& e) {
        return fail(ErrorCode::usage, "{}", printable(e.what(), 400));
    }
    return {};
}

} // namespace

void append_options(std::vector<std::string>& line, const std::vector<JobOption>& options)
{
    for (const auto& [option, value] : options) {
        line.push_back(option);
        if (!value.empty())
            line.push_back(value);
    }
}

Status check_command(const std::vector<std::string>& arguments)
{
    const Globals globals;
    CLI::App app("", "semrover");
    Run run;
    add_task_commands(app, globals, run);
    return parse(app, arguments);
}

Status run_command(const std::vector<std::string>& arguments, const Globals& globals)
{
    CLI::App app("", "semrover");
    Run run;
    add_task_commands(app, globals, run);
    SR_CHECK(parse(app, arguments));
    return run.work();
}

Status run_scenes_command(const std::vector<std::string>& arguments)
{
    SR_TRY(system::Process child, start_scenes(arguments, system::Process::Pipe::none));
    return wait_for(child);
}

} // namespace semrover
