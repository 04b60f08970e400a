// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_BUCKET_STARTS_H
#define SEMROVER_BUCKET_STARTS_H
#include "shaders/lib/types.h"

struct BucketStartsPush {
    uint size; // capacity of keys
    uint buckets;
};

#endif
