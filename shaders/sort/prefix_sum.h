// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_PREFIX_SUM_H
#define SEMROVER_PREFIX_SUM_H
#include "shaders/lib/types.h"

struct PrefixSumPush {
    uint size;    // elements of x
    uint workers; // each sums one contiguous chunk
};

#endif
