// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"

#include <initializer_list>

namespace semrover {

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
