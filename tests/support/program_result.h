// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/scratch_folder.h"

#include <string>

namespace semrover {

struct ProgramResult {
    int code; // exit status, 128 + signal when killed
    std::string out, err;
};

// runs `PROGRAM ARGUMENTS` (a line for the shell) and waits
ProgramResult run_program_line(const std::string& program, const std::string& arguments);

} // namespace semrover
