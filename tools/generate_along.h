// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/generation.h"

namespace semrover {

struct AlongOptions {
    std::string path;
    double horizon = 30; // metres to either side and ahead
    double window = 10;  // metres of path at a time
    double tile_size = 38.4;
};
void add_along_options(CLI::App& command, AlongOptions& options);

struct AlongFiles {
    std::string scaffold, output; // a .sgrid or folder of tiles; the folder of tiles that is written
    uint64_t seed = 0;
};

// generate --along: grows the scaffold along the path, window by window, with everything generated before as known
// context; only the tiles around the window are in memory. OUTPUT.run keeps the state.
Status generate_along(const AlongFiles& files, const AlongOptions& along, const GenerationOptions& generation,
                      const Globals& globals);

} // namespace semrover
