// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_RENDERER_INPUT_H
#define SEMROVER_RENDERER_INPUT_H
#include "shaders/lib/types.h"

struct RendererInputPush {
    uint rows; // of y
    uint x_rows;
    uint channels;  // of a latent
    uint latents;   // in a row: 3, or 2 without the previous one
    uint latent_ld; // elements, of x, previous and buffer
    uint visible_ld;
    uint y_ld;
};

#endif
