// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_BEYOND_H
#define SEMROVER_BEYOND_H
#include "shaders/lib/types.h"

struct BeyondPush {
    uint count; // elements of both
};

#endif
