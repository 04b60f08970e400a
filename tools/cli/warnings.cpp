// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/warnings.h"

#include "tools/cli/print_stderr.h"

namespace semrover {

void print_warnings(const std::vector<std::string>& warnings, const Globals& globals)
{
    for (const std::string& warning : warnings)
        if (!globals.quiet)
            print_stderr("semrover: warning: {}\n", warning);
}

} // namespace semrover
