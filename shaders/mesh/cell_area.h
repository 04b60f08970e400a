// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_CELL_AREA_H
#define SEMROVER_CELL_AREA_H
#include "shaders/lib/types.h"

struct CellAreaPush {
    uint cells;
};

#endif
