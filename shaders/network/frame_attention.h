// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_FRAME_ATTENTION_H
#define SEMROVER_FRAME_ATTENTION_H
#include "shaders/lib/types.h"

struct FrameAttentionPush {
    uint image_rows; // from one frame to the next
    uint heads;
    uint chunks; // head_dim / 8
    uint qkv_ld; // elements
    uint y_ld;
    float scale; // log2(e) times that of the scores: the exponential is one of base 2
};

#endif
