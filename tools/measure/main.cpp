// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover-eval: what measures and verifies
#include "tools/cli/commands.h"

int main(int argc, char** argv)
{
    using namespace semrover;
    return run_program(argc, argv, {add_bench, add_eval, add_verify});
}
