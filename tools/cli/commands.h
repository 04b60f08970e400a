// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "tools/cli/interrupt.h"

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>

namespace CLI {
class App;
}

namespace semrover {

class Session;

// options that every subcommand takes, before or after its name
struct Globals {
    std::string device;    // DeviceOptions::select; empty: the best there is, or "auto" under an engine
    std::string require;   // "gpu", "any"; empty: any, or gpu under an engine
    uint64_t max_vram = 0; // bytes; 0: what the device has
    bool autotune = true;  // measure which tiles run fastest
    bool yes = false;      // replace existing files
    bool quiet = false;    // no progress
    bool verbose = false;
    bool json = false;     // results as one JSON object on standard output
    bool log_json = false; // progress as JSON lines on standard error

    // of commands that are parts of another, which says what came of them; none: each has a device of its own
    std::shared_ptr<Session> session = {};
};

// what main runs once the command line is understood; an error becomes one line and the exit code of its ErrorCode
struct Run {
    Run() = default;
    template <typename F>
    Run(F work) : work(std::move(work))
    {
    }
    std::function<Status()> work;
    // its run folder keeps what is done: where the device is lost, it runs again and goes on with a new one
    bool resumes = false;
};
Run resuming(std::function<Status()> work);

// one a file: declares the subcommand's options and, when it is the one given, sets `run`. Options live in a
// std::shared_ptr that the callback holds.
void add_bench(CLI::App& app, const Globals& globals, Run& run);
void add_convert(CLI::App& app, const Globals& globals, Run& run);
void add_dataset(CLI::App& app, const Globals& globals, Run& run);
void add_devices(CLI::App& app, const Globals& globals, Run& run);
void add_doctor(CLI::App& app, const Globals& globals, Run& run);
void add_edit(CLI::App& app, const Globals& globals, Run& run);
void add_eval(CLI::App& app, const Globals& globals, Run& run);
void add_fuse(CLI::App& app, const Globals& globals, Run& run);
void add_generate(CLI::App& app, const Globals& globals, Run& run);
void add_inpaint(CLI::App& app, const Globals& globals, Run& run);
void add_inspect(CLI::App& app, const Globals& globals, Run& run);
void add_labels(CLI::App& app, const Globals& globals, Run& run);
void add_page(CLI::App& app, const Globals& globals, Run& run);
void add_refine(CLI::App& app, const Globals& globals, Run& run);
void add_render(CLI::App& app, const Globals& globals, Run& run);
void add_run(CLI::App& app, const Globals& globals, Run& run);
void add_tile(CLI::App& app, const Globals& globals, Run& run);
void add_streets(CLI::App& app, const Globals& globals, Run& run);
void add_verify(CLI::App& app, const Globals& globals, Run& run);
void add_view(CLI::App& app, const Globals& globals, Run& run);
void add_voxelize(CLI::App& app, const Globals& globals, Run& run);

using AddCommand = void (*)(CLI::App& app, const Globals& globals, Run& run);

// One of this program's commands, or one that another of our programs runs: `semrover` finds that program beside
// itself, as git does, so that who builds only `semrover` compiles only what it runs.
struct Command {
    Command(AddCommand add) : add(add) {}
    // advice: how to get that program where it is not there; nullptr: the target `programs` builds it
    Command(const char* name, const char* program, const char* help, const char* advice = nullptr)
        : name(name), program(program), help(help), advice(advice)
    {
    }

    AddCommand add = nullptr;
    const char *name = nullptr, *program = nullptr, *help = nullptr, *advice = nullptr;
};

// Reads the command line, runs the command that it names, and prints an error as one line. Returns the exit code.
int run_program(int argc, char** argv, std::initializer_list<Command> commands);

} // namespace semrover
