// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_PICTURE_TEXELS_H
#define SEMROVER_PICTURE_TEXELS_H
#include "shaders/lib/types.h"

struct PictureTexelsPush {
    uint pixels;
};

#endif
