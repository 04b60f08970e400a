/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host whose memory is short (tests/faults/failing_memory.h) at the n-th allocation of a call: the call ends with
 * SR_ERR_OUT_OF_MEMORY and a line, is made again, and all goes on to the same bytes; nothing is left at the end. Calls
 * of each family are counted in a run without a failure; then some of all their allocations fail, one a run, and once
 * more with all that follow.
 *
 *     memory_host MODEL RENDERER FOLDER [FAILURES]
 *
 * FOLDER: for files, emptied. FAILURES (12): how many of each sort */
#include "tests/faults/failing_memory.h"
#include "tests/faults/session.h"
#include "tests/support/capi_memory.h"

enum { MOST_CALLS = 400 };

static const char* folder;
static struct host host;
static char* cache; /* of pipelines, of an earlier context */
static uint64_t cache_bytes;

/* the calls of a run, in order, and how often each allocates; then which of them is short, and where */
static struct {
    const char* name;
    unsigned long allocations;
} made[MOST_CALLS];
static int call, short_call, lasting;
static unsigned long short_at;
static int refused;

static void before_call(int attempt)
{
    if (attempt == 0)
        ++call;
    memory_fails_at(call != short_call ? ~0ul : attempt == 0 ? short_at : 0, lasting);
}

static int again(const struct session* s, const char* name, sr_status status, int attempt)
{
    const int failed = memory_failed();
    const unsigned long taken = memory_taken();
    char line[512] = "";
    memory_fails_at(0, 0);
    CHECK(call < MOST_CALLS);
    if (!short_call) {
        made[call].name = name;
        made[call].allocations = taken;
    }
    if (status == SR_OK)
        return 0;
    sr_last_error(strstr(name, "grid") && !strstr(name, "of_world") ? NULL : s->context, line, sizeof line);
    if (failed && status == SR_ERR_OUT_OF_MEMORY && (strstr(line, "memory") || strstr(line, "MEMORY")) &&
        !strchr(line, '\n') && attempt == 0) {
        ++refused;
        return 1;
    }
    fprintf(stderr, "%s, attempt %d, call %d, allocation %lu%s: %s: \"%s\"\n", name, attempt, call, short_at,
            lasting ? " and all that follow" : "", sr_status_name(status), line);
    exit(1);
}

static sr_status list_devices(void)
{
    uint32_t count = 0;
    return sr_list_devices(NULL, &count);
}

/* as an earlier process of the application's kept it */
static sr_status keep_cache(struct session* s)
{
    cache_bytes = 0;
    if (sr_context_get_pipeline_cache(s->context, NULL, &cache_bytes) != SR_OK)
        return SR_ERR_OUT_OF_MEMORY;
    free(cache);
    cache = (char*)malloc(cache_bytes);
    return sr_context_get_pipeline_cache(s->context, cache, &cache_bytes);
}

static sr_status adopt_device(struct session* s)
{
    const sr_vulkan_device vulkan = lent(&host);
    sr_context_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    desc.pipeline_cache = cache;
    desc.pipeline_cache_bytes = cache_bytes;
    return sr_context_create(&desc, &s->context);
}

static sr_status grid_of_world(struct session* s, sr_grid** grid)
{
    const sr_cell_rect all = {{-20, -20}, {20, 20}};
    sr_grid_destroy(*grid);
    return sr_world_copy_cells(s->world, &all, grid);
}

/* cells and labels are read; edits that wait are put into the grid first */
static sr_status hash_grid(struct session* s, const sr_grid* grid)
{
    static sr_cell cells[MOST_CELLS];
    uint64_t count = 0;
    const sr_status status = sr_grid_get_cells(grid, 0, MOST_CELLS, cells, &count);
    if (status == SR_OK)
        add_to_hash(s, cells, (size_t)count * sizeof *cells);
    return status;
}

static sr_status grids(struct session* s, const char* path)
{
    static sr_cell cells[MOST_CELLS];
    const sr_cell_rect window = {{0, -6}, {7, 6}};
    const uint64_t count = cells_of(&window, cells);
    sr_grid *grid = NULL, *read = NULL;
    GO(sr_grid_create(0.6, &grid));
    GO(sr_grid_set_cells(grid, cells, count / 2));
    GO(sr_grid_set_cells(grid, cells + count / 2, count - count / 2));
    GO(hash_grid(s, grid));
    GO(sr_grid_write(grid, path));
    GO(sr_grid_read(path, &read));
    GO(hash_grid(s, read));
    GO((sr_grid_destroy(read), read = NULL, grid_of_world(s, &read)));
    GO(hash_grid(s, read));
    sr_grid_destroy(grid);
    sr_grid_destroy(read);
    return SR_OK;
}

static sr_status pick(struct session* s)
{
    const sr_draw_desc draw = camera_at(1, WIDTH, HEIGHT);
    sr_pick found;
    memset(&found, 0, sizeof found);
    found.struct_size = sizeof found;
    return sr_world_pick(s->world, &draw, WIDTH / 2, HEIGHT - 4, &found);
}

static sr_status flow(struct session* s)
{
    static float flows[PIXELS * 2];
    const sr_draw_desc now = camera_at(1, WIDTH, HEIGHT), next = camera_at(1.5, WIDTH, HEIGHT);
    sr_target target;
    memset(&target, 0, sizeof target);
    target.memory = flows;
    return sr_world_flow(s->world, &now, &next, &target, NULL);
}

/* a tile that a thread could not write for lack of memory is not stored, which this says, and nothing else is lost */
static sr_status flush(struct session* s)
{
    const sr_status status = sr_world_flush(s->world);
    return status == SR_ERR_OUT_OF_MEMORY && !memory_failed() && short_call < call ? SR_OK : status;
}

static sr_status info(struct session* s)
{
    sr_world_info found;
    memset(&found, 0, sizeof found);
    found.struct_size = sizeof found;
    return sr_world_get_info(s->world, &found);
}

/* what is recorded is not executed: an error leaves commands that nobody may */
static sr_status record(struct session* s, const struct host_buffer* buffer)
{
    const struct host_commands commands = begin_commands(&host);
    sr_draw_desc draw = camera_at(1, WIDTH, HEIGHT);
    sr_status status;
    draw.color.buffer = buffer->buffer;
    status = sr_world_record(s->world, &draw, commands.commands);
    vkEndCommandBuffer(commands.commands);
    vkDestroyCommandPool(host.device, commands.pool, NULL);
    return status;
}

/* each run has files of its own */
static sr_status everything(struct session* s, int run)
{
    const struct host_buffer buffer = make_buffer(&host, PIXELS * 16);
    char tiles[1024], file[1024];
    sr_status status;
    int frame;
    snprintf(tiles, sizeof tiles, "%s/%d.tiles", folder, run);
    snprintf(file, sizeof file, "%s/%d.sgrid", folder, run);
    call = 0;
    s->hash = 14695981039346656037u;
    GO(list_devices());
    GO(open_context(&s->context));
    GO(keep_cache(s));
    end(s);
    GO(adopt_device(s));
    GO(open_world(s, tiles));
    GO(focus_world(s));
    if ((status = fill_world(s)) != SR_OK)
        return status;
    GO(draw_world(s));
    GO(edit_world(s));
    GO(info(s));
    if ((status = fill_world(s)) != SR_OK)
        return status;
    GO(draw_world(s));
    GO(pick(s));
    GO(flow(s));
    GO(record(s, &buffer));
    GO(flush(s));
    if ((status = grids(s, file)) != SR_OK)
        return status;
    GO(open_renderer(s));
    for (frame = 0; frame < FRAMES; ++frame) {
        GO(refine_frame(s, frame));
        GO(take_frame(s));
    }
    destroy_buffer(&host, &buffer);
    end(s);
    CHECK(sr_grid_read(NULL, NULL) == SR_ERR_USAGE); /* the line of this thread is always the same */
    return SR_OK;
}

static unsigned long print_calls(void)
{
    unsigned long all = 0;
    int i;
    for (i = 1; i <= call; ++i) {
        all += made[i].allocations;
        if (i == 1 || strcmp(made[i].name, made[i - 1].name))
            printf("%s: %lu allocations\n", made[i].name, made[i].allocations);
    }
    return all;
}

int main(int argc, char** argv)
{
    struct session s;
    char command[2048];
    uint64_t expected;
    long alive;
    int failures, i, last, wrong = 0;
    CHECK(argc == 4 || argc == 5);
    memset(&s, 0, sizeof s);
    s.model = argv[1];
    s.weights = argv[2];
    folder = argv[3];
    snprintf(command, sizeof command, "rm -rf '%s' && mkdir -p '%s'", folder, folder);
    CHECK(system(command) == 0);
    failures = argc == 5 ? atoi(argv[4]) : 12;
    host = make_host();
    CHECK(everything(&s, -1) == SR_OK); /* caches are warm */
    CHECK(everything(&s, 0) == SR_OK);
    expected = s.hash;
    alive = memory_alive();
    last = call;
    printf("%d calls, %lu allocations\n", last, print_calls());
    for (i = 0; i < 2 * failures; ++i) {
        const double golden = 0.6180339887 * (i / 2 + 1);
        lasting = i % 2;
        short_call = 1 + (int)((i / 2) * (double)last / failures) % last;
        short_at = 1 + (unsigned long)((golden - (int)golden) * (double)made[short_call].allocations);
        CHECK(everything(&s, i + 1) == SR_OK);
        if (s.hash != expected)
            fprintf(stderr, "other bytes after %s, call %d, allocation %lu%s\n", made[short_call].name, short_call,
                    short_at, lasting ? " and all that follow" : "");
        if (memory_alive() != alive)
            fprintf(stderr, "%ld allocations are left after %s, call %d, allocation %lu%s\n", memory_alive() - alive,
                    made[short_call].name, short_call, short_at, lasting ? " and all that follow" : "");
        wrong += s.hash != expected || memory_alive() != alive;
    }
    printf("%d failures: %d calls refused, all of them made again\n", i, refused);
    free(cache);
    destroy_host(&host);
    return wrong != 0;
}
