// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SURFACE_COLOR_H
#define SEMROVER_SURFACE_COLOR_H
#include "shaders/lib/types.h"

struct SurfaceColorPush {
    uint size; // samples
};

#endif
