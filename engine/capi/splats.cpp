// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats of a world, and pictures of them in host memory
#include "engine/capi/exchange.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

sr_array array_of(const Slot& slot)
{
    const BufferSlice slice = slot.slice();
    return {slice.buffer->handle(), slice.offset, slice.bytes};
}

Status draw_world(sr_world& world, const sr_draw_desc& d)
{
    SR_TRY(const SplatSlots images, draw_splats(world, d, "sr_world_draw"));
    const ImageSize size{d.width, d.height};
    sr_context& context = *world.context;
    SR_CHECK(hand_over(context, images.color, size, d.color));
    SR_CHECK(hand_over(context, images.surface, size, d.normal));
    SR_CHECK(hand_over(context, images.depth, size, d.depth));
    return hand_over(context, images.ids, size, d.label);
}

} // namespace

namespace semrover::capi {

Result<SplatSlots> draw_splats(sr_world& world, const sr_draw_desc& d, const char* name)
{
    SR_TRY(const SplatPool* splats, splats_of(world, name));
    const ImageSize size{d.width, d.height};
    SR_CHECK(check_size(size, "sr_draw_desc"));
    SR_CHECK(show_updates(world, true));
    sr_context& context = *world.context;
    const bool tested = d.depth_test.image;
    SR_TRY(Rasterizer * rasterizer, world.images[tested].of(*context.drawing, *splats, size, {.depth_tested = tested}));
    if (tested) {
        SR_TRY(const HostFloats depth, host_depth(d.depth_test, size));
        SR_TRY(HostCopies * copies, copies_of(context));
        SR_CHECK(copies->fetch(depth, rasterizer->z_buffer().slice()));
        SR_CHECK(rasterizer->z_scale().write(*context.drawing, z_scale(d.depth_test)));
    }
    const SplatCamera camera = pinhole_camera(d, size);
    SR_CHECK(rasterizer->draw({&camera, 1}).map([](uint32_t) {}));
    return rasterizer->images(0);
}

} // namespace semrover::capi

extern "C" {

sr_status sr_world_get_splats(sr_world* world, sr_splats* splats)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_get_splats: world is NULL");
        SR_TRY(const SplatPool* pool, splats_of(*world, "sr_world_get_splats"));
        const auto arrays = pool->scene().arrays();
        sr_splats known{};
        known.count = pool->end();
        known.version = pool->version();
        known.positions = array_of(arrays[0]);
        known.normals = array_of(arrays[1]);
        known.colors = array_of(arrays[2]);
        known.labels = array_of(arrays[3]);
        known.blocks = array_of(pool->scene().blocks());
        return write_result(known, splats, "sr_world_get_splats");
    });
}

sr_status sr_world_draw(sr_world* world, const sr_draw_desc* draw)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_draw: world is NULL");
        SR_TRY(const sr_draw_desc known, read_struct(draw, "sr_draw_desc"));
        if (known.reserved)
            return fail(ErrorCode::usage, "sr_draw_desc: reserved is not 0");
        return draw_world(*world, known);
    });
}

} // extern "C"

static_assert(sizeof(sr_array) == 24 && sizeof(sr_splats) == 136 && sizeof(sr_target) == 40);
static_assert(sizeof(sr_depth_image) == 40 && sizeof(sr_draw_desc) == 352);
