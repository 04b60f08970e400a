// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_ATTENTION_H
#define SEMROVER_ATTENTION_H
#include "shaders/lib/types.h"

struct AttentionPush {
    uint rows;   // tokens of one stream
    uint qkv_ld; // elements
    uint y_ld;
    uint heads;
    uint head_dim; // a multiple of 8
    uint words;    // of a row of the mask
    float scale;   // 1 / sqrt(head_dim)
};

#endif
