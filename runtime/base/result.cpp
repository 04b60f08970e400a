// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/result.h"

#include "runtime/base/diagnostics.h"

#include <cstdlib>

namespace semrover {

void assertion_failed(const char* condition, const char* file, int line, const std::string& message)
{
    diagnose(fmt::format("{}:{}: assertion failed: {}: {}", file, line, condition, message));
    std::abort();
}

} // namespace semrover
