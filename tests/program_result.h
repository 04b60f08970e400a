// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/scratch_folder.h"

#include <cstdlib>
#include <string>
#include <sys/wait.h>

namespace semrover {

struct ProgramResult {
    int code; // exit status, 128 + signal when killed
    std::string out, err;
};

// runs `PROGRAM ARGUMENTS` (a line for the shell) and waits
inline ProgramResult run_program_line(const std::string& program, const std::string& arguments)
{
    const ScratchFolder folder;
    std::string line = program;
    line.append(" </dev/null >").append(folder / "out").append(" 2>").append(folder / "err");
    line.append(" ").append(arguments); // last, so that they may redirect
    const int status = std::system(line.c_str());
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return {code, contents(folder / "out"), contents(folder / "err")};
}

} // namespace semrover
