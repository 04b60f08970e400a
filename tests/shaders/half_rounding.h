// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_HALF_ROUNDING_H
#define SEMROVER_HALF_ROUNDING_H
#include "shaders/lib/types.h"

struct HalfRoundingPush {
    uint count; // pairs
};

#endif
