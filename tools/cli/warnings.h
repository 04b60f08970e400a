// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"

#include <string>
#include <vector>

namespace semrover {

// on stderr, one a line; with --quiet nothing
void print_warnings(const std::vector<std::string>& warnings, const Globals& globals);

} // namespace semrover
