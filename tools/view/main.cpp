// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover-view: what looks at a world through a window
#include "tools/cli/commands.h"

int main(int argc, char** argv)
{
    using namespace semrover;
    return run_program(argc, argv, {add_view});
}
