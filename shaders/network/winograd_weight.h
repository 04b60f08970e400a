// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_WINOGRAD_WEIGHT_H
#define SEMROVER_WINOGRAD_WEIGHT_H
#include "shaders/lib/types.h"

struct WinogradWeightPush {
    uint outputs;
    uint cols; // channels, padded
    uint w_ld; // elements
    uint u_ld;
};

#endif
