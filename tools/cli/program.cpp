// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/commands.h"

#include "engine/job/version.h"
#include "runtime/base/diagnostics.h"
#include "runtime/base/file.h"
#include "runtime/base/quote.h"
#include "runtime/system/process.h"
#include "runtime/system/system.h"
#include "tools/cli/interrupt.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <new>
#include <optional>
#include <system_error>
#include <vector>

namespace semrover {

namespace {

void print_diagnostic(void*, const char* line)
{
    print_stderr("{}\n", line);
}

void add_globals(CLI::App& app, Globals& globals)
{
    app.add_option("--device", globals.device,
                   "device name, index, UUID or PCI address (see: semrover devices), or auto");
    add_choice(app, "--require", {"gpu", "any"},
               "gpu: a CPU is an error, as it is under Slurm, Kubernetes and AWS Batch; any", globals.require);
    const auto set_max_vram = [&globals](const std::string& text) {
        const auto bytes = parse_memory_size(text);
        if (!bytes)
            throw CLI::ValidationError("--max-vram", bytes.error().message);
        if (*bytes == 0)
            throw CLI::ValidationError("--max-vram", "expected more than nothing, found " + quote(text));
        globals.max_vram = *bytes;
    };
    app.add_option_function<std::string>("--max-vram", set_max_vram,
                                         "device memory to use at most, such as 6GiB, 500MB or 2.2 (GB)");
    app.add_flag("!--no-autotune", globals.autotune, "do not measure which tiles run fastest; the bytes are the same");
    app.add_flag("-y,--yes", globals.yes, "replace existing files");
    app.add_flag("-q,--quiet", globals.quiet, "no progress");
    app.add_flag("-v,--verbose", globals.verbose, "more detail");
    app.add_flag("--json", globals.json, "results as one JSON object");
    app.add_flag("--log-json", globals.log_json, "progress as JSON lines");
}

int report(ErrorCode code, std::string_view message)
{
    claim_last_word();
    print_stderr("semrover: error: {}\n", message);
    return static_cast<int>(code);
}

// what a buffer still holds may not fit the disk, or nobody may read it
int report_output()
{
    const bool written = std::fflush(stdout) == 0 && !std::ferror(stdout) && std::cout.flush().good();
    if (!written)
        return report(ErrorCode::bad_input, "cannot write to standard output");
    claim_last_word();
    return 0;
}

// This command belongs to another program of ours, which lies beside this one and takes the same command line. Returns
// only if that program cannot be started.
Status run_neighbour(const Command& command, const std::vector<std::string>& words)
{
    const Path program = system::own_program().replace_filename(command.program);
    system::hold_stop_requests(); // what comes from here on reaches that program; what came before would be forgotten
    if (interrupt_requested())
        return fail(ErrorCode::interrupted, "interrupted");
    const int error = system::become(program, words);
    return fail(ErrorCode::bad_input, "{} is run by {}, which cannot be started ({}): {}", command.name,
                quote_path(program), system::message_of(error),
                command.advice ? command.advice : "cmake --build --preset release --target programs builds it");
}

void add_neighbour(CLI::App& app, const Command& command, const std::vector<std::string>& words, Run& run)
{
    CLI::App* c = app.add_subcommand(command.name, command.help);
    c->prefix_command(); // what follows is the other program's
    c->fallthrough(false);
    c->set_help_flag();
    c->callback([&command, &words, &run] { run = Run([&command, &words] { return run_neighbour(command, words); }); });
}

// an empty text is a variable that was not set, in a script: it names no file and means nothing
void refuse_empty_values(CLI::App& command)
{
    for (CLI::Option* option : command.get_options())
        if (option->get_items_expected_max() > 0)
            option->check([](const std::string& text) {
                return text.empty() ? std::string("expected a value, found an empty text") : std::string();
            });
    for (CLI::App* sub : command.get_subcommands({}))
        if (!sub->get_prefix_command())
            refuse_empty_values(*sub);
}

// the subcommand that the command line names, through all levels
const CLI::App& chosen(const CLI::App& app)
{
    const std::vector<CLI::App*> next = app.get_subcommands();
    return next.empty() ? app : chosen(*next.front());
}

int show_help(const CLI::App& app, const CLI::ParseError& request)
{
    if (app.count("--json") > 0 && dynamic_cast<const CLI::CallForHelp*>(&request))
        fmt::print("{}\n", json_text(options_json(chosen(app))));
    else
        app.exit(request); // --help, --version
    return report_output();
}

// the exit code of a command line that names nothing to run: help, or a mistake
std::optional<int> parse(CLI::App& app, const std::vector<std::string>& words, const Run& run)
{
    try {
        app.parse(std::vector(words.rbegin(), words.rend() - 1)); // the last first, without the program's name
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0)
            return show_help(app, e);
        return report(ErrorCode::usage,
                      fmt::format("{} (semrover --help lists commands and options)", printable(e.what(), 400)));
    }
    if (!run.work)
        return report(ErrorCode::usage, "no command given (semrover --help lists them)");
    return std::nullopt;
}

constexpr int kMostDevices = 3; // that are lost, before the error stands

} // namespace

// nothing thrown by the standard library or fmt leaves the program without a line and a code
int run_program(int argc, char** argv, std::initializer_list<Command> commands)
{
    system::prepare_streams();
    set_diagnostic_callback(print_diagnostic);
    watch_interrupts();
    try {
        const std::vector<std::string> words = system::arguments(argc, argv);
        CLI::App app("turn a semantic voxel grid into a coloured 3D street scene, and drive a camera rig through it",
                     "semrover");
        app.set_version_flag("--version", kProgram);
        app.allow_windows_style_options(false); // a path may begin with a slash
        app.fallthrough();                      // global options may follow the subcommand
        app.require_subcommand(0, 1);           // a later word is no command, as in `eval labels`, or a folder `render`
        Globals globals;
        add_globals(app, globals);
        Run run;
        for (const Command& command : commands)
            if (command.add)
                command.add(app, globals, run);
            else
                add_neighbour(app, command, words, run);
        refuse_empty_values(app);
        if (const std::optional<int> code = parse(app, words, run))
            return *code;
        Status status = run.work();
        for (int lost = 1;
             run.resumes && !status && status.error().code == ErrorCode::device_lost && lost < kMostDevices; ++lost) {
            if (!globals.quiet)
                print_stderr("semrover: warning: {}; going on with a new device from what is done\n",
                             status.error().message);
            status = run.work();
        }
        return status ? report_output() : report(status.error().code, status.error().message);
    } catch (const std::bad_alloc&) {
        return report(ErrorCode::out_of_memory, "the host's memory is exhausted");
    } catch (const std::system_error& e) { // of a write to a closed or full output
        return report(ErrorCode::bad_input, printable(e.what()));
    } catch (const std::exception& e) {
        return report(ErrorCode::internal,
                      fmt::format("a fault in semrover, please report it: {}", printable(e.what())));
    }
}

} // namespace semrover
