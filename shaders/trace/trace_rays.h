// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_TRACE_RAYS_H
#define SEMROVER_TRACE_RAYS_H
#include "shaders/lib/types.h"

struct TraceRaysPush {
    uint rows; // rays
};

#endif
