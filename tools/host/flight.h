/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What a sample host does beside its frames: a thread that steps the world, and a clock that says for how long calls
 * kept the thread that draws. */
#ifndef HOST_FLIGHT_H
#define HOST_FLIGHT_H

#include "gpu.h"

#include <pthread.h>

struct worker {
    sr_world* world;
    const sr_context* context;
    pthread_t thread;
    pthread_mutex_t mutex;
    pthread_cond_t settled_now;
    int ended;
    unsigned asked, settled; /* worker_wait() has been called so often; and of these has nothing left to do */
};

void worker_begin(struct worker* worker, sr_world* world, const sr_context* context);
void worker_wait(struct worker* worker); /* until all that is wanted now is there: for pictures, not for frame loops */
void worker_end(struct worker* worker);  /* joins it; before the world goes */

enum { MOST_CALLS = 1 << 16 };

/* how long each call took, in seconds */
struct calls {
    const char* name;
    size_t count;
    double seconds[MOST_CALLS];
};

double clock_now(void);
void calls_add(struct calls* calls, double since);
void calls_print(struct calls* calls, size_t kinds); /* p50, p99 and the worst of each */

#endif
