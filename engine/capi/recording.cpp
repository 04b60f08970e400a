// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// draws that nobody waits for: in a command buffer of the application's, or submitted between semaphores of its own
#include "engine/capi/draws.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

Status check_targets(const sr_draw_desc& d)
{
    for (const sr_target* target : targets_of(d))
        if (target->memory)
            return fail(ErrorCode::usage, "sr_draw_desc: what is recorded goes to buffers and images, not to memory");
    return {};
}

// a command buffer of the world's own, begun
Result<VkCommandBuffer> begin(sr_world& world)
{
    if (!world.commands) {
        SR_TRY(world.commands, CommandRing::create(*world.context->drawing));
    }
    return world.commands->begin();
}

Status check_device(const sr_world& world, const char* name)
{
    if (world.context->device->owned())
        return fail(ErrorCode::usage, "{}: the context is not on a device of the application's", name);
    return {};
}

// draws and copies, into a command buffer that is being recorded
Status record(sr_world& world, const sr_draw_desc& d, VkCommandBuffer commands, const char* name)
{
    Device& device = *world.context->drawing;
    SR_CHECK(check_device(world, name));
    SR_CHECK(check_targets(d));
    SR_TRY(const PictureFormats formats, formats_of(d));
    SR_TRY(const WorldDraw draw, draw_of(world, d, formats));
    SR_TRY(const SplatSlots images, record_splats(world, draw, commands, name));
    for (const auto& [pixels, target, size] : wanted_pictures(d, formats, images))
        record_external_target(device, commands, pixels, external_target(*target, size));
    return {};
}

Result<std::vector<TimelinePoint>> points_of(const sr_semaphore* semaphores, uint32_t count, const char* name)
{
    if (count && !semaphores)
        return fail(ErrorCode::usage, "sr_sync: {} is NULL", name);
    std::vector<TimelinePoint> points;
    for (uint32_t i = 0; i < count; ++i) {
        if (!semaphores[i].semaphore)
            return fail(ErrorCode::usage, "sr_sync: semaphore {} of {} is NULL", i, name);
        points.push_back({semaphores[i].semaphore, semaphores[i].value});
    }
    return points;
}

Status submit(sr_world& world, const sr_draw_desc& d, const sr_sync& sync)
{
    if (sync.reserved)
        return fail(ErrorCode::usage, "sr_sync: reserved is not 0");
    TimelinePoints points;
    SR_TRY(points.waits, points_of(sync.waits, sync.wait_count, "waits"));
    SR_TRY(points.signals, points_of(sync.signals, sync.signal_count, "signals"));
    if (world.world->splats())
        SR_CHECK(show_updates(world, false));
    SR_TRY(const VkCommandBuffer commands, begin(world));
    world.done = world.context->drawing->next_point();
    SR_CHECK(record(world, d, commands, "sr_world_submit"));
    return world.commands->submit(points).map([](uint64_t) {});
}

} // namespace

namespace semrover::capi {

Result<SplatSlots> record_splats(sr_world& world, const WorldDraw& draw, VkCommandBuffer commands, const char* name)
{
    Device& device = *world.context->drawing;
    SR_TRY(const SplatPool* splats, splats_of(world, name));
    Rasterizers::Retired retired;
    const auto found = world.recorded.of(device, *splats, draw.size(), draw.options, 1, &retired);
    for (std::shared_ptr<Rasterizer>& last : retired)
        world.retired.emplace_back(world.done, std::move(last));
    SR_TRY(Rasterizer * rasterizer, found);
    if (draw.options.depth_tested) {
        SR_TRY(const ExternalImage depth, external_depth(draw.depth_test, draw.size()));
        const BufferSlice z = rasterizer->z_buffer().slice();
        record_image_fetch(device.vk(), commands, depth, z.buffer->handle(), z.offset);
    }
    SR_CHECK(rasterizer->record(commands, draw.camera(), z_scale(draw.depth_test), draw.depth_scale,
                                world.actors.seen_by({&draw.frame, 1}, draw.options.moving)));
    return rasterizer->images(0);
}

Result<bool> record_updates(sr_world& world, VkCommandBuffer commands, const TimelinePoint& done)
{
    for (size_t i = world.retired.size(); i-- > 0;) {
        auto& [point, rasterizer] = world.retired[i];
        if (!point.semaphore) { // recorded before the application has named a point
            point = done;
            continue;
        }
        SR_TRY(const bool reached, world.context->drawing->reached(point));
        if (reached)
            world.retired.erase(world.retired.begin() + ptrdiff_t(i));
    }
    return world.world->splats()->record_updates(commands);
}

Status show_updates(sr_world& world, bool wait)
{
    Device& device = *world.context->drawing;
    SR_TRY(const VkCommandBuffer commands, begin(world));
    SR_TRY(const bool some, record_updates(world, commands, device.next_point()));
    if (!some)
        return {};
    const TimelinePoint done = device.next_point();
    SR_TRY(const uint64_t ticket, world.commands->submit());
    world.done = done;
    world.world->splats()->updates_are_submitted(done);
    return wait ? device.wait(ticket) : Status();
}

} // namespace semrover::capi

extern "C" {

sr_status sr_world_record(sr_world* world, const sr_draw_desc* draw, VkCommandBuffer commands)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world || !commands)
            return fail(ErrorCode::usage, "sr_world_record: NULL");
        SR_TRY(const sr_draw_desc known, read_struct(draw, "sr_draw_desc"));
        return record(*world, known, commands, "sr_world_record");
    });
}

sr_status sr_world_record_updates(sr_world* world, VkCommandBuffer commands, const sr_semaphore* done)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world || !commands || !done || !done->semaphore)
            return fail(ErrorCode::usage, "sr_world_record_updates: NULL");
        SR_CHECK(check_device(*world, "sr_world_record_updates"));
        SR_CHECK(splats_of(*world, "sr_world_record_updates").map([](SplatPool*) {}));
        world->updated_by_application = true;
        world->done = {done->semaphore, done->value};
        SR_TRY(const bool some, record_updates(*world, commands, world->done));
        if (some)
            world->world->splats()->updates_are_submitted(world->done);
        return {};
    });
}

sr_status sr_world_submit(sr_world* world, const sr_draw_desc* draw, const sr_sync* sync)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_submit: world is NULL");
        SR_TRY(const sr_draw_desc known, read_struct(draw, "sr_draw_desc"));
        SR_TRY(const sr_sync known_sync, read_struct(sync, "sr_sync"));
        return submit(*world, known, known_sync);
    });
}

sr_status sr_world_check_draws(sr_world* world)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_check_draws: world is NULL");
        if (!world->recorded.were_whole())
            return fail(ErrorCode::partial, "a picture lacks splats: there is more room for the next one");
        return {};
    });
}

} // extern "C"

static_assert(sizeof(sr_semaphore) == 16 && sizeof(sr_sync) == 40);
