// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_FACTOR_RATE_H
#define SEMROVER_FACTOR_RATE_H
#include "shaders/lib/types.h"

struct FactorRatePush {
    uint rounds; // of eight loads a thread, or of 16 products a subgroup, or 32
    uint units;  // of x that are read, eight fp16 each: a power of two
};

#endif
