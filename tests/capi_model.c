/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * An application in C that loads models: what they hold, progress, loads that are given up, and weights that worlds and
 * renderers share.
 *
 *     capi_model MODEL RENDERER RENDERER_OF_VIDEOS BOTH     MODEL: a voxfield transformer alone; BOTH: that and a
 * renderer, conditioned on objects */
#include "tests/support/capi_street.h"

enum { GIVEN_UP = 20, MOST_CALLS = 4096 };

static uint64_t used_bytes(sr_context* context)
{
    sr_memory_info memory;
    memset(&memory, 0, sizeof memory);
    memory.struct_size = sizeof memory;
    CHECK_OK(context, sr_context_get_memory(context, &memory));
    return memory.used_bytes;
}

static sr_model_info info_of(const sr_model* model)
{
    sr_model_info info;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK(sr_model_get_info(model, &info) == SR_OK);
    return info;
}

static void says_what_it_holds(sr_context* context, const char* voxfield, const char* renderer, const char* video,
                               const char* both)
{
    const char* const paths[4] = {voxfield, renderer, video, both};
    const uint32_t parts[4] = {SR_MODEL_VOXFIELD, SR_MODEL_RENDERER, SR_MODEL_RENDERER,
                               SR_MODEL_VOXFIELD | SR_MODEL_RENDERER};
    int i;
    for (i = 0; i < 4; ++i) {
        const uint64_t before = used_bytes(context);
        sr_model* model = load_model(context, paths[i]);
        const sr_model_info info = info_of(model);
        CHECK(info.parts == parts[i] && info.precision == SR_FP16);
        CHECK(used_bytes(context) == before + info.device_bytes && info.device_bytes > 0);
        CHECK((info.voxel_size == 0.6) == (i % 3 == 0) && (info.points_per_voxel == 20) == (i % 3 == 0));
        CHECK((info.steps > 0) == (i % 3 == 0) && (info.renderer_steps > 0) == (i > 0));
        CHECK(info.window_frames == (i == 0   ? 0u
                                     : i == 2 ? info.window_frames
                                              : 1u) &&
              (i != 2 || info.window_frames > 1));
        CHECK((info.conditions & SR_CONDITION_OBJECTS) == (i == 3));
        sr_model_destroy(model);
        CHECK(used_bytes(context) == before);
    }
    sr_model_destroy(NULL);
}

static void loads_what_is_asked_for(sr_context* context, const char* voxfield, const char* both)
{
    sr_model_desc desc = model_at(both);
    sr_model* model = NULL;
    uint64_t half;
    desc.parts = SR_MODEL_RENDERER;
    CHECK_OK(context, sr_model_load(context, &desc, &model));
    CHECK(info_of(model).parts == SR_MODEL_RENDERER);
    half = info_of(model).device_bytes;
    sr_model_destroy(model);
    desc.precision = SR_FP32;
    CHECK_OK(context, sr_model_load(context, &desc, &model));
    CHECK(info_of(model).precision == SR_FP32 && info_of(model).device_bytes > half * 3 / 2);
    sr_model_destroy(model);
    desc = model_at(voxfield);
    desc.parts = SR_MODEL_VOXFIELD | SR_MODEL_RENDERER;
    CHECK(sr_model_load(context, &desc, &model) == SR_ERR_BAD_INPUT && says(context, "renderer") && !model);
}

static void refuses_wrong_models(sr_context* context, const char* voxfield)
{
    sr_model_desc desc = model_at("/nonesuch");
    sr_model* model = (sr_model*)&desc;
    sr_model_info info;
    memset(&info, 0, sizeof info);
    CHECK(sr_model_load(context, &desc, &model) == SR_ERR_BAD_INPUT && says(context, "nonesuch") && !model);
    CHECK(sr_model_load(context, NULL, &model) == SR_ERR_USAGE && says(context, "sr_model_desc: NULL"));
    CHECK(sr_model_load(NULL, &desc, &model) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_model_load(context, &desc, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    desc = model_at(voxfield);
    desc.parts = 4;
    CHECK(sr_model_load(context, &desc, &model) == SR_ERR_USAGE && says(context, "parts is 4"));
    desc = model_at(voxfield);
    desc.precision = 2;
    CHECK(sr_model_load(context, &desc, &model) == SR_ERR_USAGE && says(context, "precision is 2"));
    desc = model_at(voxfield);
    desc.reserved = 1;
    CHECK(sr_model_load(context, &desc, &model) == SR_ERR_USAGE && says(context, "reserved"));
    CHECK(sr_model_get_info(NULL, &info) == SR_ERR_USAGE && says(NULL, "model is NULL"));
    model = load_model(context, voxfield);
    CHECK(sr_model_get_info(model, &info) == SR_ERR_USAGE && says(context, "struct_size"));
    sr_model_destroy(model);
}

/* of a load: how often it was called, and when it gives up */
struct progress {
    sr_context* context;
    uint64_t done, total;
    uint32_t calls, last_call;
};

static uint32_t on_progress(void* user, uint64_t done, uint64_t total)
{
    struct progress* p = user;
    sr_memory_info memory = SR_INIT(sr_memory_info);
    CHECK(sr_context_get_memory(p->context, &memory) == SR_ERR_USAGE && says(NULL, "another call is at work"));
    CHECK(done >= p->done && done <= total && (!p->calls || total == p->total));
    p->done = done;
    p->total = total;
    CHECK(p->calls < MOST_CALLS);
    return ++p->calls == p->last_call;
}

/* at moments between the first and the last tensor; the next load is as if there had been none */
static void loads_can_be_given_up(sr_context* context, const char* both)
{
    const uint64_t before = used_bytes(context);
    struct progress whole, part;
    sr_model_desc desc = model_at(both);
    sr_model* model = NULL;
    uint32_t i;
    memset(&whole, 0, sizeof whole);
    whole.context = context;
    desc.progress = on_progress;
    desc.user = &whole;
    CHECK_OK(context, sr_model_load(context, &desc, &model));
    CHECK(whole.calls > GIVEN_UP && whole.done == whole.total && whole.total <= info_of(model).device_bytes);
    sr_model_destroy(model);
    for (i = 0; i < GIVEN_UP; ++i) {
        memset(&part, 0, sizeof part);
        part.context = context;
        part.last_call = 1 + i * (whole.calls - 1) / (GIVEN_UP - 1);
        desc.user = &part;
        CHECK(sr_model_load(context, &desc, &model) == SR_ERR_INTERRUPTED && says(context, "cancelled") && !model);
        CHECK(part.calls == part.last_call && (i == 0) == (part.done == 0));
        CHECK(used_bytes(context) == before);
    }
    printf("given up at %d of %u calls\n", GIVEN_UP, (unsigned)whole.calls);
}

/* bytes of a world or renderer without its weights */
static void weights_are_there_once(sr_context* context, const char* both)
{
    const uint64_t empty = used_bytes(context);
    sr_model* model = load_model(context, both);
    const uint64_t weights = info_of(model).device_bytes;
    sr_world_desc world_desc = street_world();
    sr_renderer_desc renderer_desc;
    sr_world* worlds[2] = {NULL, NULL};
    sr_renderer* cameras[2] = {NULL, NULL};
    uint64_t bytes[5];
    int i;
    world_desc.model = model;
    memset(&renderer_desc, 0, sizeof renderer_desc);
    renderer_desc.struct_size = sizeof renderer_desc;
    renderer_desc.model = model;
    renderer_desc.width = 24;
    renderer_desc.height = 16;
    renderer_desc.steps = 1;
    bytes[0] = used_bytes(context);
    CHECK(bytes[0] == empty + weights);
    for (i = 0; i < 2; ++i) {
        CHECK_OK(context, sr_world_create(context, &world_desc, &worlds[i]));
        bytes[1 + i] = used_bytes(context);
    }
    for (i = 0; i < 2; ++i) {
        CHECK_OK(context, sr_renderer_create(context, &renderer_desc, &cameras[i]));
        bytes[3 + i] = used_bytes(context);
    }
    CHECK(bytes[2] - bytes[1] == bytes[1] - bytes[0]); /* the second takes what the first took beside the weights */
    CHECK(bytes[4] - bytes[3] == bytes[3] - bytes[2]);
    printf("weights %lu bytes, a world beside them %lu, a renderer %lu\n", (unsigned long)weights,
           (unsigned long)(bytes[1] - bytes[0]), (unsigned long)(bytes[3] - bytes[2]));
    sr_model_destroy(model);
    CHECK(used_bytes(context) == bytes[4]); /* they go on */
    walk(context, worlds[1], 1, 1);
    for (i = 0; i < 2; ++i) {
        sr_renderer_destroy(cameras[i]);
        sr_world_destroy(worlds[i]);
    }
    CHECK(used_bytes(context) == empty);
}

static void belongs_to_its_context(sr_context* context, const char* both)
{
    sr_context* other = NULL;
    sr_model* model = load_model(context, both);
    sr_world_desc world_desc = street_world();
    sr_renderer_desc renderer_desc;
    sr_world* world = NULL;
    sr_renderer* renderer = NULL;
    CHECK(sr_context_create(NULL, &other) == SR_OK);
    world_desc.model = model;
    CHECK(sr_world_create(other, &world_desc, &world) == SR_ERR_USAGE && says(other, "another context") && !world);
    memset(&renderer_desc, 0, sizeof renderer_desc);
    renderer_desc.struct_size = sizeof renderer_desc;
    renderer_desc.model = model;
    renderer_desc.width = renderer_desc.height = 16;
    CHECK(sr_renderer_create(other, &renderer_desc, &renderer) == SR_ERR_USAGE && says(other, "another context") &&
          !renderer);
    sr_context_destroy(other);
    sr_model_destroy(model);
}

int main(int argc, char** argv)
{
    sr_context* context = NULL;
    CHECK(argc == 5);
    sr_set_diagnostic_callback(print_line, stderr);
    CHECK_OK(NULL, sr_context_create(NULL, &context));
    says_what_it_holds(context, argv[1], argv[2], argv[3], argv[4]);
    loads_what_is_asked_for(context, argv[1], argv[4]);
    refuses_wrong_models(context, argv[1]);
    loads_can_be_given_up(context, argv[4]);
    weights_are_there_once(context, argv[4]);
    belongs_to_its_context(context, argv[4]);
    sr_context_destroy(context);
    return 0;
}
