// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/program.h"

#include "engine/job/version.h"
#include "runtime/base/diagnostics.h"
#include "runtime/base/file.h"
#include "runtime/base/quote.h"
#include "tools/cli/memory_size.h"

#include <cerrno>
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <system_error>
#include <unistd.h>

namespace semrover {

namespace {

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int)
{
    interrupted = 1;
}

void print_diagnostic(void*, const char* line)
{
    fmt::print(stderr, "{}\n", line);
}

void install_signal_handlers()
{
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND); // the second signal is not caught
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

void add_globals(CLI::App& app, Globals& globals)
{
    app.add_option("--device", globals.device, "device name or index (see: semrover devices)");
    const auto set_max_vram = [&globals](const std::string& text) {
        const auto bytes = parse_memory_size(text);
        if (!bytes)
            throw CLI::ValidationError("--max-vram", bytes.error().message);
        globals.max_vram = *bytes;
    };
    app.add_option_function<std::string>("--max-vram", set_max_vram,
                                         "device memory to use at most, such as 6GiB, 500MB or 2.2 (GB)");
    app.add_flag("-y,--yes", globals.yes, "replace existing files");
    app.add_flag("-q,--quiet", globals.quiet, "no progress");
    app.add_flag("-v,--verbose", globals.verbose, "more detail");
    app.add_flag("--json", globals.json, "results as one JSON object");
    app.add_flag("--log-json", globals.log_json, "progress as JSON lines");
}

int report(ErrorCode code, std::string_view message)
{
    fmt::print(stderr, "semrover: error: {}\n", message);
    return static_cast<int>(code);
}

// nothing thrown by the standard library or fmt leaves the program without a line and a code
int run_and_report(const Run& run)
{
    try {
        if (const Status status = run(); !status)
            return report(status.error().code, status.error().message);
        if (std::fflush(stdout) != 0)
            return report(ErrorCode::bad_input, "cannot write to standard output");
        return 0;
    } catch (const std::bad_alloc&) {
        return report(ErrorCode::out_of_memory, "the host's memory is exhausted");
    } catch (const std::system_error& e) { // of a write to a closed or full output
        return report(ErrorCode::bad_input, printable(e.what()));
    } catch (const std::exception& e) {
        return report(ErrorCode::internal,
                      fmt::format("a fault in semrover, please report it: {}", printable(e.what())));
    }
}

// This command belongs to another program of ours, which lies beside this one and takes the same command line. Returns
// only if that program cannot be started.
Status run_neighbour(const Command& command, char** argv)
{
    std::error_code error;
    Path program = std::filesystem::read_symlink("/proc/self/exe", error);
    program.replace_filename(command.program);
    execv(program.c_str(), argv);
    return fail(
        ErrorCode::bad_input,
        "{} is run by {}, which cannot be started ({}): cmake --build --preset release --target programs builds it",
        command.name, quote_path(program), std::strerror(errno));
}

void add_neighbour(CLI::App& app, const Command& command, char** argv, Run& run)
{
    CLI::App* c = app.add_subcommand(command.name, command.help);
    c->prefix_command(); // what follows is the other program's
    c->fallthrough(false);
    c->set_help_flag();
    c->callback([&command, argv, &run] { run = [&command, argv] { return run_neighbour(command, argv); }; });
}

} // namespace

bool interrupt_requested()
{
    return interrupted != 0;
}

int run_program(int argc, char** argv, std::initializer_list<Command> commands)
{
    set_diagnostic_callback(print_diagnostic);
    install_signal_handlers();
    CLI::App app("turn a semantic voxel grid into a coloured 3D street scene, and drive a camera rig through it",
                 "semrover");
    app.set_version_flag("--version", kProgram);
    app.fallthrough(); // global options may follow the subcommand
    Globals globals;
    add_globals(app, globals);
    Run run;
    for (const Command& command : commands)
        if (command.add)
            command.add(app, globals, run);
        else
            add_neighbour(app, command, argv, run);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0)
            return app.exit(e); // --help, --version
        return report(ErrorCode::usage,
                      fmt::format("{} (semrover --help lists commands and options)", printable(e.what(), 400)));
    }
    if (!run)
        return report(ErrorCode::usage, "no command given (semrover --help lists them)");
    return run_and_report(run);
}

} // namespace semrover
