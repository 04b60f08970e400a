// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_FILL_H
#define SEMROVER_FILL_H
#include "shaders/lib/types.h"

struct FillPush {
    uint size;
    uint value;
};

#endif
