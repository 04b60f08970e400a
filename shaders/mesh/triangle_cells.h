// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_TRIANGLE_CELLS_H
#define SEMROVER_TRIANGLE_CELLS_H
#include "shaders/lib/types.h"

struct TriangleCellsPush {
    uint size;     // triangles
    uint capacity; // pairs that can be written
};

#endif
