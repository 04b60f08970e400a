/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host that runs for long: it flies to and fro along a street that grows around it, edits it, changes the size of its
 * pictures, refines frames, and starts anew where its GPU is lost, which tests/vendors/failing_gpu.cpp does now and
 * then. Its memory, files and threads stay as many. Prints a line now and then: seconds, MiB of the process, files,
 * threads, MiB on the device, pictures, edits, frames, losses.
 *     soak_host MODEL RENDERER SECONDS */
#define _POSIX_C_SOURCE 200809L
#include "tests/support/capi_street.h"

#include <dirent.h>
#include <math.h>
#include <time.h>
#include <unistd.h>

enum { MOST_SIZE = 96, FRAME = 32, LINES = 60, LENGTH = 40 };

struct session {
    sr_context* context;
    sr_world* world;
    sr_renderer* renderer;
};
struct counts {
    unsigned pictures, edits, frames, losses;
};
struct usage {
    double resident, device; /* MiB */
    unsigned files, threads;
};

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static unsigned random_below(unsigned limit)
{
    static uint32_t state = 1;
    state = state * 1664525 + 1013904223;
    return (state >> 8) % limit;
}

static unsigned entries_of(const char* folder)
{
    unsigned count = 0;
    DIR* directory = opendir(folder);
    CHECK(directory);
    while (readdir(directory))
        ++count;
    closedir(directory);
    return count;
}

static struct usage usage_of(sr_context* context)
{
    struct usage u;
    long pages = 0;
    sr_memory_info memory;
    FILE* file = fopen("/proc/self/statm", "r");
    CHECK(file && fscanf(file, "%*d %ld", &pages) == 1);
    fclose(file);
    memset(&memory, 0, sizeof memory);
    memory.struct_size = sizeof memory;
    CHECK(sr_context_get_memory(context, &memory) == SR_OK);
    u.resident = (double)pages * (double)sysconf(_SC_PAGESIZE) / (1 << 20);
    u.device = (double)memory.used_bytes / (1 << 20);
    u.files = entries_of("/proc/self/fd");
    u.threads = entries_of("/proc/self/task");
    return u;
}

static void end(struct session* h)
{
    sr_renderer_destroy(h->renderer);
    sr_world_destroy(h->world);
    sr_context_destroy(h->context);
    memset(h, 0, sizeof *h);
}

static sr_status begin(struct session* h, const char* model, const char* weights)
{
    sr_context_desc context = {0};
    sr_world_desc world = street_world();
    sr_renderer_desc renderer = {0};
    sr_status status;
    context.struct_size = sizeof context;
    renderer.struct_size = sizeof renderer;
    renderer.width = renderer.height = FRAME;
    renderer.steps = 1;
    renderer.noise = SR_NOISE_FRESH;
    world.host_bytes = 1 << 20;
    status = sr_context_create(&context, &h->context);
    if (status == SR_OK)
        status = create_world(h->context, model, &world, &h->world);
    return status == SR_OK ? create_renderer(h->context, weights, &renderer, &h->renderer) : status;
}

static sr_status fly_to(struct session* h, double x)
{
    const double position[3] = {x, 0, 1.5}, forward[3] = {1, 0, 0};
    uint32_t done = 0;
    sr_status status = sr_world_focus(h->world, position, forward, 8);
    return status == SR_OK ? sr_world_step(h->world, 4000, &done) : status;
}

static sr_status edit(struct session* h, double x)
{
    sr_cell cell = {0};
    cell.i = (int32_t)(x / 0.6);
    cell.j = (int32_t)random_below(5);
    cell.k = 1;
    cell.label = random_below(2) ? 13 : SR_NO_CELL;
    return sr_world_edit(h->world, &cell, 1);
}

static sr_status draw(struct session* h, double x)
{
    static float color[MOST_SIZE * MOST_SIZE * 4];
    sr_draw_desc d = camera_at(x, 8 + random_below(MOST_SIZE - 8), 8 + random_below(MOST_SIZE - 8));
    d.color.memory = color;
    return sr_world_draw(h->world, &d);
}

static sr_status refine(struct session* h, double x)
{
    static uint8_t pixels[FRAME * FRAME * 4];
    sr_frame_desc frame = {0};
    sr_target target = {0};
    uint32_t done = 0;
    sr_status status;
    frame.struct_size = sizeof frame;
    frame.world = h->world;
    frame.fx = frame.fy = frame.cx = frame.cy = FRAME / 2;
    look(x, frame.world_to_camera);
    status = sr_renderer_begin(h->renderer, &frame);
    while (status == SR_OK && !done)
        status = sr_renderer_step(h->renderer, 4000, &done);
    target.memory = pixels;
    return status == SR_OK ? sr_renderer_take(h->renderer, &target) : status;
}

/* a moment of the flight: there and back again */
static sr_status moment(struct session* h, struct counts* counts, unsigned at)
{
    const double way = fmod(0.2 * at, 2 * LENGTH), x = way < LENGTH ? way : 2 * LENGTH - way;
    sr_status status = fly_to(h, x);
    if (status == SR_OK && at % 7 == 0 && ++counts->edits)
        status = edit(h, x + 3);
    if (status == SR_OK && ++counts->pictures)
        status = draw(h, x);
    if (status == SR_OK && at % 20 == 0 && ++counts->frames)
        status = refine(h, x);
    return status;
}

static void print(double since, const struct usage* u, const struct counts* c)
{
    printf("%7.0f s %7.1f MiB %3u files %3u threads %6.1f MiB on the device %7u pictures %6u edits %5u frames %4u "
           "losses\n",
           since, u->resident, u->files, u->threads, u->device, c->pictures, c->edits, c->frames, c->losses);
    fflush(stdout);
}

/* the greatest of some lines */
static struct usage most(const struct usage* lines, int from, int to)
{
    struct usage m = lines[from];
    for (; from < to; ++from) {
        m.resident = fmax(m.resident, lines[from].resident);
        m.device = fmax(m.device, lines[from].device);
        m.files = lines[from].files > m.files ? lines[from].files : m.files;
        m.threads = lines[from].threads > m.threads ? lines[from].threads : m.threads;
    }
    return m;
}

int main(int argc, char** argv)
{
    struct session host = {0};
    struct counts counts = {0};
    struct usage lines[LINES], early, late;
    unsigned at = 0;
    int line = 0;
    double began, length;
    CHECK(argc == 4);
    length = atof(argv[3]);
    CHECK(length > 0);
    for (began = seconds(); line < LINES;) {
        sr_status status = host.context ? moment(&host, &counts, ++at) : begin(&host, argv[1], argv[2]);
        if (status == SR_ERR_DEVICE_LOST) {
            ++counts.losses;
            end(&host);
            continue;
        }
        CHECK_OK(host.context, status);
        if (seconds() - began >= length * (line + 1) / LINES) {
            lines[line] = usage_of(host.context);
            print(seconds() - began, &lines[line], &counts);
            ++line;
        }
    }
    end(&host);
    early = most(lines, LINES / 4, LINES / 2);
    late = most(lines, LINES / 2, LINES);
    printf("second half, of the second quarter: %+.1f MiB, %+d files, %+d threads, %+.1f MiB on the device\n",
           late.resident - early.resident, (int)(late.files - early.files), (int)(late.threads - early.threads),
           late.device - early.device);
    CHECK(counts.losses > 0 && counts.frames > 0 && counts.edits > 0);
    CHECK(late.files <= early.files && late.threads <= early.threads);
    CHECK(late.device <= early.device * 1.01 && late.resident <= early.resident * 1.02 + 2);
    return 0;
}
