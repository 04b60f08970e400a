/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * An application in C whose floating numbers are wrong, one at a time: each is refused, and none taken as another.
 *
 *     capi_numbers MODEL     conditioned on objects */
#include "tests/support/capi_street.h"

#include <math.h>
#include <stddef.h>

struct number {
    const char* name;
    size_t at;       /* of the first, bytes */
    int is_float;    /* or else double */
    int below_zero;  /* -1 has a meaning */
    sr_status wrong; /* what the call returns */
};

#define NUMBER(type, member, is_float, below_zero, wrong)                                                              \
    {                                                                                                                  \
#member, offsetof(type, member), is_float, below_zero, wrong                                                   \
    }

static const struct number generation_numbers[] = {
    NUMBER(sr_generation, eta, 0, 0, SR_ERR_USAGE),
    NUMBER(sr_generation, guidance_scale, 0, 0, SR_ERR_USAGE),
    NUMBER(sr_generation, guidance_radius, 0, 0, SR_ERR_USAGE),
};
static const struct number world_numbers[] = {
    NUMBER(sr_world_desc, tile_size, 0, 0, SR_ERR_USAGE),
    NUMBER(sr_world_desc, splat_radius, 0, 0, SR_ERR_USAGE),
    NUMBER(sr_world_desc, detail_distance, 0, 0, SR_ERR_USAGE),
};
static const struct number object_numbers[] = {
    NUMBER(sr_object, center[0], 0, 1, SR_ERR_BAD_INPUT), NUMBER(sr_object, center[1], 0, 1, SR_ERR_BAD_INPUT),
    NUMBER(sr_object, center[2], 0, 1, SR_ERR_BAD_INPUT), NUMBER(sr_object, size[0], 0, 0, SR_ERR_BAD_INPUT),
    NUMBER(sr_object, size[1], 0, 0, SR_ERR_BAD_INPUT),   NUMBER(sr_object, size[2], 0, 0, SR_ERR_BAD_INPUT),
    NUMBER(sr_object, heading, 0, 1, SR_ERR_BAD_INPUT),   NUMBER(sr_object, color[0], 1, 0, SR_ERR_BAD_INPUT),
    NUMBER(sr_object, color[1], 1, 0, SR_ERR_BAD_INPUT),  NUMBER(sr_object, color[2], 1, 0, SR_ERR_BAD_INPUT),
};
static const struct number draw_numbers[] = {
    NUMBER(sr_draw_desc, fx, 0, 1, SR_ERR_BAD_INPUT),      NUMBER(sr_draw_desc, fy, 0, 1, SR_ERR_BAD_INPUT),
    NUMBER(sr_draw_desc, cx, 0, 1, SR_ERR_BAD_INPUT),      NUMBER(sr_draw_desc, cy, 0, 1, SR_ERR_BAD_INPUT),
    NUMBER(sr_draw_desc, depth_scale, 0, 1, SR_ERR_USAGE), NUMBER(sr_draw_desc, depth_offset, 0, 1, SR_ERR_USAGE),
};
/* whose line says "focus", whichever number is wrong */
#define FOCUS_NUMBER(member, below_zero)                                                                               \
    {                                                                                                                  \
        "focus", offsetof(sr_focus, member), 0, below_zero, SR_ERR_USAGE                                               \
    }
static const struct number focus_numbers[] = {
    FOCUS_NUMBER(position[0], 1),  FOCUS_NUMBER(position[1], 1),  FOCUS_NUMBER(position[2], 1),
    FOCUS_NUMBER(direction[0], 1), FOCUS_NUMBER(direction[1], 1), FOCUS_NUMBER(direction[2], 1),
    FOCUS_NUMBER(radius, 0),
};
static const struct number depth_numbers[] = {
    NUMBER(sr_depth_image, scale, 0, 1, SR_ERR_USAGE),
    NUMBER(sr_depth_image, offset, 0, 1, SR_ERR_USAGE),
};

/* what is called with a structure that has a wrong number */
typedef sr_status (*call_with)(sr_context* context, void* structure);

#define EACH_IS_REFUSED(context, numbers, structure, call)                                                             \
    each_is_refused(context, numbers, sizeof numbers / sizeof *numbers, &structure, call)

static void each_is_refused(sr_context* context, const struct number* numbers, size_t count, void* structure,
                            call_with call)
{
    const double wrong[] = {NAN, INFINITY, -1};
    size_t i, w;
    for (i = 0; i < count; ++i)
        for (w = 0; w < 3 - (size_t)numbers[i].below_zero; ++w) {
            char* at = (char*)structure + numbers[i].at;
            const float narrow = (float)wrong[w];
            const size_t bytes = numbers[i].is_float ? sizeof narrow : sizeof *wrong;
            char kept[sizeof(double)];
            sr_status status;
            memcpy(kept, at, bytes);
            memcpy(at, numbers[i].is_float ? (const void*)&narrow : (const void*)&wrong[w], bytes);
            status = call(context, structure);
            if (status != numbers[i].wrong) {
                fprintf(stderr, "%s: %s for %g\n", numbers[i].name, sr_status_name(status), wrong[w]);
                exit(1);
            }
            CHECK(status == SR_ERR_BAD_INPUT || says(context, numbers[i].name));
            memcpy(at, kept, bytes);
        }
}

static sr_world_desc right_desc; /* with the model */
static sr_world* drawn;

static sr_status make_world(sr_context* context, void* desc)
{
    sr_world* world = NULL;
    const sr_status status = sr_world_create(context, desc, &world);
    CHECK((status == SR_OK) == (world != NULL));
    sr_world_destroy(world);
    return status;
}

static sr_status make_world_with(sr_context* context, void* generation)
{
    sr_world_desc desc = right_desc;
    desc.generation = generation;
    return make_world(context, &desc);
}

static sr_status make_world_of(sr_context* context, void* object)
{
    sr_world_desc desc = right_desc;
    desc.conditioning = SR_CONDITIONING_GIVEN;
    desc.objects = object;
    desc.object_count = 1;
    return make_world(context, &desc);
}

static sr_status draw(sr_context* context, void* desc)
{
    (void)context;
    return sr_world_draw(drawn, desc);
}

static sr_status look_around(sr_context* context, void* focus)
{
    (void)context;
    return sr_world_foci(drawn, focus, 1);
}

static sr_status draw_behind(sr_context* context, void* depth_image)
{
    sr_draw_desc picture = camera_at(1, 64, 40);
    (void)context;
    picture.depth_test = *(const sr_depth_image*)depth_image;
    return sr_world_draw(drawn, &picture);
}

static void timesteps_have_bounds(sr_context* context, sr_generation generation)
{
    generation.guidance_until = 10001;
    CHECK(make_world_with(context, &generation) == SR_ERR_USAGE && says(context, "guidance_until is 10001"));
    generation.guidance_until = 10000;
    generation.guidance_from = (uint32_t)-1;
    CHECK(make_world_with(context, &generation) == SR_ERR_USAGE && says(context, "guidance_from is 4294967295"));
    generation.guidance_from = 10000;
    CHECK_OK(context, make_world_with(context, &generation));
}

int main(int argc, char** argv)
{
    sr_context* context = NULL;
    sr_model* model;
    sr_generation generation = SR_INIT(sr_generation);
    sr_object object = {.label = 2, .size = {9, 1.2, 2.4}, .colored = 1};
    sr_draw_desc picture = camera_at(1, 64, 40);
    sr_focus focus = {.position = {1, 0, 1.5}, .direction = {1, 0, 0}, .radius = 3};
    size_t i;
    sr_depth_image depth_image = {.image = (VkImage)(size_t)1, /* which nobody looks at */
                                  .format = VK_FORMAT_R32_SFLOAT,
                                  .layout_before = VK_IMAGE_LAYOUT_GENERAL,
                                  .layout_after = VK_IMAGE_LAYOUT_GENERAL,
                                  .scale = 1};
    CHECK(argc == 2);
    sr_set_diagnostic_callback(print_line, stderr);
    CHECK_OK(NULL, sr_context_create(NULL, &context));
    model = load_model(context, argv[1]);
    right_desc = street_world();
    right_desc.model = model;
    CHECK_OK(context, sr_model_get_generation(model, &generation));
    CHECK_OK(context, make_world(context, &right_desc));
    CHECK_OK(context, make_world_with(context, &generation));
    CHECK_OK(context, make_world_of(context, &object));
    EACH_IS_REFUSED(context, generation_numbers, generation, make_world_with);
    EACH_IS_REFUSED(context, object_numbers, object, make_world_of);
    EACH_IS_REFUSED(context, world_numbers, right_desc, make_world);
    timesteps_have_bounds(context, generation);

    CHECK(sr_world_create(context, &right_desc, &drawn) == SR_OK);
    CHECK_OK(context, sr_world_draw(drawn, &picture));
    EACH_IS_REFUSED(context, draw_numbers, picture, draw);
    for (i = 0; i < 12; ++i) {
        struct number number = NUMBER(sr_draw_desc, world_to_camera, 0, 1, SR_ERR_BAD_INPUT);
        number.at += i * sizeof(double);
        each_is_refused(context, &number, 1, &picture, draw);
    }
    CHECK_OK(context, look_around(context, &focus));
    EACH_IS_REFUSED(context, focus_numbers, focus, look_around);
    EACH_IS_REFUSED(context, depth_numbers, depth_image, draw_behind);
    sr_world_destroy(drawn);
    sr_model_destroy(model);
    sr_context_destroy(context);
    return 0;
}
