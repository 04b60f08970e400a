// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_RADIX_SORT_H
#define SEMROVER_RADIX_SORT_H
#include "shaders/lib/types.h"

struct RadixSortPush {
    uint size;    // capacity in pairs
    uint workers; // each sorts one contiguous chunk
    uint shift;   // first bit of the digit
    uint buckets; // 2^(bits of the digit), at most 256
};

#endif
