// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/program_result.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <string>
#include <string_view>

namespace semrover {

// runs `semrover ARGUMENTS` (a line for the shell) and waits
inline ProgramResult semrover_program(const std::string& arguments)
{
    return run_program_line(SEMROVER_BINARY, arguments);
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
