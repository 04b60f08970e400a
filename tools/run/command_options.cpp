// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/command_options.h"

#include "runtime/base/quote.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

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

struct Child {
    pid_t pid = -1;
    int output = -1; // what it prints; -1: it goes to standard error
};

Result<Child> spawn_scenes(const std::vector<std::string>& arguments, bool read_output)
{
    std::error_code error;
    Path file = std::filesystem::read_symlink("/proc/self/exe", error);
    file.replace_filename(kScenesProgram);
    std::vector<std::string> words{"semrover"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words)
        argv.push_back(word.data());
    argv.push_back(nullptr);
    int ends[2] = {-1, -1};
    if (read_output && ::pipe2(ends, O_CLOEXEC) != 0)
        return fail(ErrorCode::bad_input, "cannot make a pipe: {}", std::strerror(errno));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, read_output ? ends[1] : STDERR_FILENO, STDOUT_FILENO);
    Child child{.output = ends[0]};
    const int failed = posix_spawn(&child.pid, file.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (read_output)
        ::close(ends[1]);
    if (!failed)
        return child;
    if (read_output)
        ::close(ends[0]);
    return fail(ErrorCode::bad_input,
                "{} cannot be started ({}): cmake --build --preset release --target programs "
                "builds it",
                quote_path(file), std::strerror(failed));
}

Status wait_for(const Child& child)
{
    int status = 0;
    while (::waitpid(child.pid, &status, 0) < 0)
        if (errno != EINTR)
            return fail(ErrorCode::bad_input, "cannot wait for {}: {}", kScenesProgram, std::strerror(errno));
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
        return {};
    if (WIFEXITED(status))
        return fail(ErrorCode(WEXITSTATUS(status)), "{} ended with code {}", kScenesProgram, WEXITSTATUS(status));
    return fail(ErrorCode::interrupted, "{} was ended by signal {}", kScenesProgram, WTERMSIG(status));
}

Result<Json> facts_of_neighbour(const char* command)
{
    SR_TRY(const Child child, spawn_scenes({command, "--help", "--json"}, true));
    std::string text;
    char bytes[4096];
    for (ssize_t n; (n = ::read(child.output, bytes, sizeof bytes)) != 0;)
        if (n > 0)
            text.append(bytes, size_t(n));
        else if (errno != EINTR)
            break;
    ::close(child.output);
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
    return fmt::format(" from {} to {}", facts["least"].dump(), facts["most"].dump());
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
    SR_TRY(const Child child, spawn_scenes(arguments, false));
    return wait_for(child);
}

} // namespace semrover
