// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_PAIR_CELLS_H
#define SEMROVER_PAIR_CELLS_H
#include "shaders/lib/types.h"

struct PairCellsPush {
    uint size; // keys
};

#endif
