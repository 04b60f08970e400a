// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_BLEND_H
#define SEMROVER_BLEND_H
#include "shaders/lib/types.h"

struct BlendPush {
    uint rows;
    uint cols;
    uint x_ld;
    uint z_ld;
    uint y_ld;
};

#endif
