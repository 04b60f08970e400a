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

// what a draw reads beside splats and camera. z: of depth_test, with the layout that it has
Status fill_inputs(sr_context& context, Rasterizer& rasterizer, const sr_draw_desc& d, HostImage& z)
{
    if (rasterizer.format_scale().valid())
        SR_CHECK(rasterizer.format_scale().write(*context.drawing, depth_scale(d)));
    if (!z.image)
        return {};
    SR_TRY(HostCopies * copies, copies_of(context));
    SR_CHECK(copies->fetch(z, rasterizer.z_buffer().slice()));
    z.before = z.after;
    return rasterizer.z_scale().write(*context.drawing, z_scale(d.depth_test));
}

Status draw_world(sr_world& world, const sr_draw_desc& d)
{
    SR_TRY(const PictureFormats formats, formats_of(d));
    SR_TRY(const SplatSlots images, draw_splats(world, d, formats, "sr_world_draw"));
    for (const WantedPicture& wanted : wanted_pictures(d, formats, images))
        SR_CHECK(hand_over(*world.context, wanted.pixels, {d.width, d.height}, *wanted.target));
    return {};
}

} // namespace

namespace semrover::capi {

Result<SplatSlots> draw_splats(sr_world& world, const sr_draw_desc& d, const PictureFormats& formats, const char* name)
{
    SR_TRY(const SplatPool* splats, splats_of(world, name));
    const ImageSize size{d.width, d.height};
    SR_CHECK(check_size(size, "sr_draw_desc"));
    SR_CHECK(show_updates(world, true));
    sr_context& context = *world.context;
    const bool tested = d.depth_test.image;
    SR_TRY(Rasterizer * rasterizer,
           world.images[tested].of(*context.drawing, *splats, size, {.depth_tested = tested, .formats = formats}));
    HostImage z;
    if (tested) {
        SR_TRY(z, host_depth(d.depth_test, size));
    }
    const SplatCamera camera = pinhole_camera(d, size);
    for (uint32_t rebuilds = ~0u; rebuilds != rasterizer->rebuilds();) { // with what is filled in memory of its own
        rebuilds = rasterizer->rebuilds();
        SR_CHECK(fill_inputs(context, *rasterizer, d, z));
        SR_CHECK(rasterizer->draw({&camera, 1}).map([](uint32_t) {}));
    }
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
        return draw_world(*world, known);
    });
}

} // extern "C"

static_assert(sizeof(sr_array) == 24 && sizeof(sr_splats) == 136 && sizeof(sr_target) == 48);
static_assert(sizeof(sr_depth_image) == 40 && sizeof(sr_draw_desc) == 400);
