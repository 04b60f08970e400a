// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/scratch_folder.h"

#include <algorithm>
#include <cstdlib>
#include <gtest/gtest.h>
#include <string>
#include <string_view>
#include <sys/wait.h>

namespace semrover {

struct ProgramResult {
    int code; // exit status, 128 + signal when killed
    std::string out, err;
};

// runs `semrover ARGUMENTS` (a line for the shell) and waits
inline ProgramResult semrover_program(const std::string& arguments)
{
    const ScratchFolder folder;
    std::string line = SEMROVER_BINARY;
    line.append(" </dev/null >").append(folder / "out").append(" 2>").append(folder / "err");
    line.append(" ").append(arguments); // last, so that they may redirect
    const int status = std::system(line.c_str());
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return {code, contents(folder / "out"), contents(folder / "err")};
}

// an error of the program: its code, one line that says the text, and nothing else
inline void expect_error(const ProgramResult& result, int code, std::string_view text)
{
    EXPECT_EQ(result.code, code) << result.err;
    EXPECT_TRUE(result.err.starts_with("semrover: error: ")) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.out, "");
}

} // namespace semrover
