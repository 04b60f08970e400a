// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/result.h"

#include "runtime/base/assertion.h"
#include "runtime/base/diagnostics.h"

#include <cstdlib>

namespace semrover {

namespace {

thread_local bool assertions_throw = false;

} // namespace

AssertionsThrow::AssertionsThrow() : before_(assertions_throw)
{
    assertions_throw = true;
}

AssertionsThrow::~AssertionsThrow()
{
    assertions_throw = before_;
}

void assertion_failed(const char* condition, const char* file, int line, const std::string& message)
{
    const std::string text = fmt::format("{}:{}: assertion failed: {}: {}", file, line, condition, message);
    if (assertions_throw)
        throw AssertionFailed(text);
    diagnose(text);
    std::abort();
}

} // namespace semrover
