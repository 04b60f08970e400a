// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_PICTURE_INPUT_H
#define SEMROVER_PICTURE_INPUT_H
#include "shaders/lib/types.h"

struct PictureInputPush {
    uint rows;          // of y
    uint width, height; // of the picture
    uint y_width, y_height;
    uint y_ld;
};

#endif
