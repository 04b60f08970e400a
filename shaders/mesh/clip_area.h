// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_CLIP_AREA_H
#define SEMROVER_CLIP_AREA_H
#include "shaders/lib/types.h"

struct ClipAreaPush {
    uint size; // capacity of pairs
};

#endif
