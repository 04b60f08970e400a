// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SPLAT_LIMITS_H
#define SEMROVER_SPLAT_LIMITS_H
#include "shaders/lib/types.h"

struct SplatLimitsPush {
    uint pixels;
};

#endif
