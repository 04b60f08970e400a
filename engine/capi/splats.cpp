// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats of a world, and pictures of them in host memory
#include "engine/capi/draws.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

sr_array array_of(const DeviceTensor& slot)
{
    const BufferSlice slice = slot.slice();
    return {slice.buffer->handle(), slice.offset, slice.bytes};
}

// what a draw reads beside splats and camera. z: of depth_test, with the layout that it has
Status fill_inputs(sr_context& context, Rasterizer& rasterizer, const WorldDraw& draw, ExternalImage& z)
{
    if (rasterizer.format_scale().valid())
        SR_CHECK(rasterizer.format_scale().write(*context.drawing, draw.depth_scale));
    if (!z.image)
        return {};
    SR_TRY(ExternalCopies * copies, copies_of(context));
    SR_CHECK(copies->fetch(z, rasterizer.z_buffer().slice()));
    z.before = z.after;
    return rasterizer.z_scale().write(*context.drawing, z_scale(draw.depth_test));
}

Status draw_world(sr_world& world, std::span<const sr_draw_desc> descs, const char* name)
{
    SR_CHECK(splats_of(world, name).map([](SplatPool*) {}));
    std::vector<WorldDraw> draws;
    for (const sr_draw_desc& desc : descs) {
        SR_TRY(const PictureFormats formats, formats_of(desc));
        SR_TRY(draws.emplace_back(), draw_of(world, desc, formats));
    }
    SR_CHECK(show_updates(world, true));
    for (size_t i = 0, end = 0; i < draws.size();) {
        for (end = i + 1; end < draws.size() && draws[i].goes_with(draws[end]);)
            ++end;
        SR_TRY(const std::vector<SplatSlots> drawn, draw_splats(world, std::span(draws).subspan(i, end - i), name));
        std::vector<WantedPicture> pictures;
        for (const SplatSlots& images : drawn) {
            const std::vector<WantedPicture> wanted = wanted_pictures(descs[i], draws[i].options.formats, images);
            pictures.insert(pictures.end(), wanted.begin(), wanted.end());
            ++i;
        }
        SR_CHECK(hand_over(*world.context, pictures));
    }
    return {};
}

// of an array of the caller's, whose elements may be smaller than ours
Result<std::vector<sr_draw_desc>> read_draws(const sr_draw_desc* draws, uint32_t count)
{
    if (!count)
        return fail(ErrorCode::usage, "sr_world_draws: count is 0");
    SR_TRY(const sr_draw_desc first, read_struct(draws, "sr_draw_desc"));
    std::vector<sr_draw_desc> known{first};
    for (uint32_t i = 1; i < count; ++i) {
        const auto* at = reinterpret_cast<const unsigned char*>(draws) + size_t(i) * first.struct_size;
        uint32_t size = 0;
        std::memcpy(&size, at, sizeof size);
        if (size != first.struct_size || size % alignof(sr_draw_desc))
            return fail(ErrorCode::usage, "sr_world_draws: draw {} has struct_size {}, the first has {}", i, size,
                        first.struct_size);
        SR_TRY(known.emplace_back(), read_struct(reinterpret_cast<const sr_draw_desc*>(at), "sr_draw_desc"));
    }
    return known;
}

} // namespace

namespace semrover::capi {

Result<std::vector<SplatSlots>> draw_splats(sr_world& world, std::span<const WorldDraw> draws, const char* name)
{
    SR_TRY(const SplatPool* splats, splats_of(world, name));
    const WorldDraw& first = draws[0];
    sr_context& context = *world.context;
    SR_TRY(Rasterizer * rasterizer,
           world.images.of(*context.drawing, *splats, first.size(), first.options, uint32_t(draws.size())));
    ExternalImage z;
    if (first.options.depth_tested) {
        SR_TRY(z, external_depth(first.depth_test, first.size()));
    }
    std::vector<SplatCamera> cameras;
    std::vector<CameraFrame> frames;
    for (const WorldDraw& draw : draws) {
        frames.push_back(draw.frame);
        cameras.push_back(draw.camera());
    }
    const SplatMovers movers = world.actors.seen_by(frames, first.options.moving);
    uint32_t drawn = 0;
    for (uint32_t rebuilds = ~0u; rebuilds != rasterizer->rebuilds();) { // with what is filled in memory of its own
        rebuilds = rasterizer->rebuilds();
        SR_CHECK(fill_inputs(context, *rasterizer, first, z));
        SR_TRY(drawn, rasterizer->draw(cameras, movers));
    }
    std::vector<SplatSlots> images;
    for (uint32_t camera = 0; camera < drawn; ++camera)
        images.push_back(rasterizer->images(camera));
    return images;
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
        return draw_world(*world, {&known, 1}, "sr_world_draw");
    });
}

sr_status sr_world_draws(sr_world* world, const sr_draw_desc* draws, uint32_t count)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_draws: world is NULL");
        SR_TRY(const std::vector<sr_draw_desc> known, read_draws(draws, count));
        return draw_world(*world, known, "sr_world_draws");
    });
}

} // extern "C"

static_assert(sizeof(sr_array) == 24 && sizeof(sr_splats) == 136 && sizeof(sr_target) == 48);
static_assert(sizeof(sr_depth_image) == 40 && sizeof(sr_draw_desc) == 768);
