// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_GATHER_TEXELS_H
#define SEMROVER_GATHER_TEXELS_H
#include "shaders/lib/types.h"

struct GatherTexelsPush {
    uint size;  // addresses
    uint first; // address of the page's first texel
    uint texels;
};

#endif
