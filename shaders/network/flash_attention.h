// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_FLASH_ATTENTION_H
#define SEMROVER_FLASH_ATTENTION_H
#include "shaders/lib/types.h"

struct FlashAttentionPush {
    uint rows;      // of y that are written, of one image
    uint first_row; // of this band
    uint queries;   // of one image; rows from here on are padding
    uint keys;
    uint query_rows; // from one image to the next
    uint key_rows;
    uint q_ld; // elements
    uint kv_ld;
    uint y_ld;
    uint q_col; // first column of head 0
    uint k_col;
    uint v_col;
    uint chunks; // head_dim / 8
    float scale; // log2(e) times that of the scores: the exponential is one of base 2
};

#endif
