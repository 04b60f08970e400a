// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_EMBEDDING_H
#define SEMROVER_EMBEDDING_H
#include "shaders/lib/types.h"

struct EmbeddingPush {
    uint rows;
    uint cols;
    uint table_rows;
    uint table_ld; // elements
    uint x_ld;
    uint y_ld;
};

#endif
