// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats of a world, and pictures of them in the host's memory
#include "engine/capi/call.h"
#include "engine/capi/handles.h"

#include <cmath>

using namespace semrover;
using namespace semrover::capi;

namespace {

constexpr uint32_t kMostPixels = 16384; // of a side

Result<const SplatPool*> splats_of(const sr_world& world, const char* name)
{
    const SplatPool* splats = world.world->splats();
    if (!splats)
        return fail(ErrorCode::usage, "{}: the world was created without splat_bytes", name);
    return splats;
}

sr_array array_of(const Slot& slot)
{
    const BufferSlice slice = slot.slice();
    return {slice.buffer->handle(), slice.offset, slice.bytes};
}

SplatCamera camera_of(const sr_draw_desc& d)
{
    SplatCamera camera{float(d.fx), float(d.fy), float(d.cx), float(d.cy)};
    for (size_t i = 0; i < 12; ++i)
        camera.world_to_camera[i] = float(d.world_to_camera[i]);
    return camera;
}

// the program of a size, which stays for the next draw
Status make_rasterizer(sr_world& world, const SplatPool& splats, uint32_t width, uint32_t height)
{
    if (world.rasterizer && world.width == width && world.height == height)
        return {};
    world.rasterizer.reset(); // its memory goes before the next one's comes
    SR_TRY(world.rasterizer, Rasterizer::create(*world.context->device, splats.scene(), width, height, 1));
    world.width = width;
    world.height = height;
    return {};
}

Status hand_over(sr_world& world, const Slot& pixels, const sr_target& to)
{
    Device& device = *world.context->device;
    if (to.memory)
        SR_CHECK(device.read(pixels.slice(), {static_cast<std::byte*>(to.memory), size_t(pixels.bytes())}));
    if (!to.buffer && !to.image)
        return {};
    if (!world.copies) {
        SR_TRY(world.copies, HostCopies::create(device));
    }
    HostTarget target{.buffer = static_cast<VkBuffer>(to.buffer), .offset = to.buffer_offset};
    target.image = {static_cast<VkImage>(to.image), world.width, world.height, VkImageLayout(to.layout_before),
                    VkImageLayout(to.layout_after)};
    return world.copies->copy(pixels.slice(), target);
}

Status draw_world(sr_world& world, const sr_draw_desc& d)
{
    SR_TRY(const SplatPool* splats, splats_of(world, "sr_world_draw"));
    if (d.width < 1 || d.height < 1 || d.width > kMostPixels || d.height > kMostPixels)
        return fail(ErrorCode::usage, "sr_draw_desc: {} x {} pixels; 1 to {} are possible", d.width, d.height,
                    kMostPixels);
    SR_CHECK(make_rasterizer(world, *splats, d.width, d.height));
    const SplatCamera camera = camera_of(d);
    SR_CHECK(world.rasterizer->draw({&camera, 1}).map([](uint32_t) {}));
    const SplatSlots images = world.rasterizer->images(0);
    SR_CHECK(hand_over(world, images.color, d.color));
    SR_CHECK(hand_over(world, images.surface, d.normal));
    SR_CHECK(hand_over(world, images.depth, d.depth));
    return hand_over(world, images.ids, d.label);
}

} // namespace

extern "C" {

sr_status sr_world_get_splats(sr_world* world, sr_splats* splats)
{
    return guarded(world ? world->context : nullptr, [&]() -> Status {
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
        return write_result(known, splats, "sr_world_get_splats");
    });
}

sr_status sr_world_draw(sr_world* world, const sr_draw_desc* draw)
{
    return guarded(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_draw: world is NULL");
        SR_TRY(const sr_draw_desc known, read_struct(draw, "sr_draw_desc"));
        if (known.reserved)
            return fail(ErrorCode::usage, "sr_draw_desc: reserved is not 0");
        return draw_world(*world, known);
    });
}

} // extern "C"

static_assert(sizeof(sr_array) == 24 && sizeof(sr_splats) == 112 && sizeof(sr_target) == 40);
static_assert(sizeof(sr_draw_desc) == 312);
