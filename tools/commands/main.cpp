// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover: what a newcomer runs; the rest is in programs beside it
#include "tools/cli/commands.h"

int main(int argc, char** argv)
{
    using namespace semrover;
    return run_program(
        argc, argv,
        {{"bench", "semrover-eval", "measure kernels and stages on this device"},
         add_convert,
         add_dataset,
         add_devices,
         add_doctor,
         add_edit,
         {"eval", "semrover-eval", "measure how far apart two sets of results are, or a result and the truth"},
         {"fuse", "semrover-scenes", "depth, poses, labels and colours of frames to a mesh and grids"},
         add_generate,
         add_inpaint,
         add_inspect,
         add_labels,
         add_page,
         add_refine,
         add_render,
         add_run,
         add_tile,
         {"streets", "semrover-scenes", "make up a street: mesh, grids, a drive, and pictures to train with"},
         {"verify", "semrover-eval", "run golden cases: what public reference code gives for known inputs"},
         {"view", "semrover-view", "look at a street, fly through it, paint it, refine a view",
          "it needs the packages libglfw3-dev and libimgui-dev (tools/setup --view); then cmake --preset release && "
          "cmake --build --preset release --target programs builds it"},
         {"voxelize", "semrover-scenes", "a textured mesh as a grid of labelled voxels and coloured points"}});
}
