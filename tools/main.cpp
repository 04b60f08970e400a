// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands.h"

#include "engine/version.h"
#include "runtime/quote.h"
#include "tools/memory_size.h"

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <new>
#include <system_error>

namespace semrover {

namespace {

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int)
{
    interrupted = 1;
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

} // namespace

bool interrupt_requested()
{
    return interrupted != 0;
}

} // namespace semrover

int main(int argc, char** argv)
{
    using namespace semrover;
    install_signal_handlers();
    CLI::App app("turn a semantic voxel grid into a coloured 3D street scene, and drive a camera rig through it",
                 "semrover");
    app.set_version_flag("--version", kProgram);
    app.fallthrough(); // global options may follow the subcommand
    Globals globals;
    add_globals(app, globals);
    Run run;
    add_bench(app, globals, run);
    add_convert(app, globals, run);
    add_devices(app, globals, run);
    add_doctor(app, globals, run);
    add_edit(app, globals, run);
    add_eval(app, globals, run);
    add_fuse(app, globals, run);
    add_generate(app, globals, run);
    add_inpaint(app, globals, run);
    add_inspect(app, globals, run);
    add_page(app, globals, run);
    add_refine(app, globals, run);
    add_render(app, globals, run);
    add_tile(app, globals, run);
    add_streets(app, globals, run);
    add_verify(app, globals, run);
    add_voxelize(app, globals, run);
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
