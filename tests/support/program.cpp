// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/program.h"

#include <algorithm>
#include <cstdlib>
#include <sys/wait.h>

namespace semrover {

ProgramResult run_program_line(const std::string& program, const std::string& arguments)
{
    const ScratchFolder folder;
    std::string line = program;
    line.append(" </dev/null >").append(folder / "out").append(" 2>").append(folder / "err");
    line.append(" ").append(arguments); // last, so that they may redirect
    const int status = std::system(line.c_str());
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return {code, contents(folder / "out"), contents(folder / "err")};
}

ProgramResult semrover_program(const std::string& arguments)
{
    return run_program_line(SEMROVER_BINARY, arguments);
}

ProgramResult semrover_with_lost_devices(int devices, int submits, const std::string& arguments)
{
    const std::string environment = "env VK_ADD_LAYER_PATH=" SEMROVER_LAYERS
                                    " VK_INSTANCE_LAYERS=VK_LAYER_SEMROVER_failing_gpu FAILING_GPU_DEVICES=" +
                                    std::to_string(devices) + " FAILING_GPU_AT=" + std::to_string(submits + 1) + " ";
    return run_program_line(environment + SEMROVER_BINARY, arguments);
}

void expect_error(const ProgramResult& result, int code, std::string_view text)
{
    EXPECT_EQ(result.code, code) << result.err;
    EXPECT_TRUE(result.err.starts_with("semrover: error: ")) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.out, "");
}

} // namespace semrover
