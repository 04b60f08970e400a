// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what every test program does first: lines of the runtime, which prints nothing itself, go to stderr
#include "runtime/base/diagnostics.h"

#include <cstdio>
#include <gtest/gtest.h>

int main(int argc, char** argv)
{
    semrover::set_diagnostic_callback([](void*, const char* line) { std::fprintf(stderr, "%s\n", line); });
    testing::InitGoogleTest(&argc, argv);
    const int result = RUN_ALL_TESTS();
    return testing::UnitTest::GetInstance()->test_to_run_count() ? result : 1; // a filter that names nothing
}
