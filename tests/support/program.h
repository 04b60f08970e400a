// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/program_result.h"

#include <gtest/gtest.h>
#include <string>
#include <string_view>

namespace semrover {

// runs `semrover ARGUMENTS` (a line for the shell) and waits
ProgramResult semrover_program(const std::string& arguments);

// the same with a driver whose first `devices` devices are lost after `submits` submits each
ProgramResult semrover_with_lost_devices(int devices, int submits, const std::string& arguments);

// an error of the program: its code, one line that says the text, and nothing else
void expect_error(const ProgramResult& result, int code, std::string_view text);

} // namespace semrover
