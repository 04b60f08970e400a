// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_CHANNEL_MOMENTS_H
#define SEMROVER_CHANNEL_MOMENTS_H
#include "shaders/lib/types.h"

struct ChannelMomentsPush {
    uint rows;
    uint cols;
    uint first_row;
    uint x_ld;
    uint moments_ld;
    uint moments_pixels;
    uint moments_image_rows;
};

#endif
