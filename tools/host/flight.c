/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0 */
#include "flight.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { BUDGET_US = 8000 };

static void rest(void)
{
    const struct timespec two_milliseconds = {0, 2000000};
    nanosleep(&two_milliseconds, NULL);
}

/* steps until the end; where nothing is left to do it looks again after a while */
static void* work(void* user)
{
    struct worker* w = user;
    for (;;) {
        uint32_t done = 0;
        unsigned asked;
        int ended;
        pthread_mutex_lock(&w->mutex);
        ended = w->ended;
        asked = w->asked;
        pthread_mutex_unlock(&w->mutex);
        if (ended)
            return NULL;
        check_sr(sr_world_step(w->world, BUDGET_US, &done), w->context);
        if (!done)
            continue;
        pthread_mutex_lock(&w->mutex);
        w->settled = asked;
        pthread_cond_signal(&w->settled_now);
        pthread_mutex_unlock(&w->mutex);
        rest();
    }
}

void worker_begin(struct worker* w, sr_world* world, const sr_context* context)
{
    memset(w, 0, sizeof *w);
    w->world = world;
    w->context = context;
    check(!pthread_mutex_init(&w->mutex, NULL) && !pthread_cond_init(&w->settled_now, NULL), "making a mutex");
    check(!pthread_create(&w->thread, NULL, work, w), "starting a thread");
}

void worker_wait(struct worker* w)
{
    unsigned asked;
    pthread_mutex_lock(&w->mutex);
    asked = ++w->asked;
    while (w->settled < asked)
        pthread_cond_wait(&w->settled_now, &w->mutex);
    pthread_mutex_unlock(&w->mutex);
}

void worker_end(struct worker* w)
{
    pthread_mutex_lock(&w->mutex);
    w->ended = 1;
    pthread_mutex_unlock(&w->mutex);
    check(!pthread_join(w->thread, NULL), "joining a thread");
    pthread_cond_destroy(&w->settled_now);
    pthread_mutex_destroy(&w->mutex);
}

double clock_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void calls_add(struct calls* calls, double since)
{
    if (calls->count < MOST_CALLS)
        calls->seconds[calls->count++] = clock_now() - since;
}

static int compare(const void* a, const void* b)
{
    const double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

void calls_print(struct calls* calls, size_t kinds)
{
    size_t k;
    printf("%-28s %8s %9s %9s %9s\n", "ms on the thread that draws", "calls", "p50", "p99", "worst");
    for (k = 0; k < kinds; ++k) {
        struct calls* c = &calls[k];
        if (!c->count)
            continue;
        qsort(c->seconds, c->count, sizeof *c->seconds, compare);
        printf("%-28s %8lu %9.3f %9.3f %9.3f\n", c->name, (unsigned long)c->count, 1e3 * c->seconds[c->count / 2],
               1e3 * c->seconds[(c->count - 1) * 99 / 100], 1e3 * c->seconds[c->count - 1]);
    }
}
