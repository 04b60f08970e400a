// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover-scenes: what makes grids of something else
#include "tools/cli/commands.h"

int main(int argc, char** argv)
{
    using namespace semrover;
    return run_program(argc, argv, {add_fuse, add_streets, add_voxelize});
}
