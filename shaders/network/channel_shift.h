// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_CHANNEL_SHIFT_H
#define SEMROVER_CHANNEL_SHIFT_H
#include "shaders/lib/types.h"

struct ChannelShiftPush {
    uint rows;
    uint cols;
    uint first_row;
    uint image_rows;
    uint x_ld;
    uint y_ld;
    uint shift_ld;
    uint shift_col;
};

#endif
