// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/result.h"

#include <cstdio>
#include <cstdlib>

namespace semrover {

void assertion_failed(const char* condition, const char* file, int line, const std::string& message)
{
    std::fprintf(stderr, "%s:%d: assertion failed: %s: %s\n", file, line, condition, message.c_str());
    std::abort();
}

} // namespace semrover
