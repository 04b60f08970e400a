// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// optical flow from one picture of a world to another
#include "engine/capi/draws.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// is it wanted?
Result<bool> check_flow_target(const sr_target* target, uint32_t format, const char* name)
{
    if (!target || (!target->memory && !target->buffer && !target->image))
        return false;
    if (target->reserved || (target->format && target->format != format))
        return fail(ErrorCode::usage, "sr_world_flow: {} cannot have format {}, or its reserved is not 0", name,
                    target->format);
    return true;
}

FlowDrawing& flow_of(sr_world& world)
{
    if (!world.flow || world.flow->cameras() > Rasterizers::kMost)
        world.flow = std::make_unique<FlowDrawing>(
            *world.context->drawing, world.actors, [&world](const CameraFrame& frame) -> Result<SplatSlots> {
                const WorldDraw draw{frame, drawing_options(world, frame, FlowDrawing::surface_options({}))};
                SR_TRY(const std::vector<SplatSlots> images, draw_splats(world, {&draw, 1}, "sr_world_flow"));
                return images[0];
            });
    return *world.flow;
}

Status draw_flow(sr_world& world, const sr_draw_desc& now, const sr_draw_desc& next, const sr_target* flow,
                 const sr_target* states)
{
    SR_TRY(const bool want_flow, check_flow_target(flow, VK_FORMAT_R32G32_SFLOAT, "flow"));
    SR_TRY(const bool want_states, check_flow_target(states, VK_FORMAT_R32_UINT, "states"));
    if (!want_flow && !want_states)
        return fail(ErrorCode::usage, "sr_world_flow: neither flow nor states has a target");
    SR_CHECK(splats_of(world, "sr_world_flow").map([](SplatPool*) {}));
    SR_TRY(CameraFrame from, frame_of(now));
    SR_TRY(CameraFrame to, frame_of(next));
    const ImageSize size{now.width, now.height};
    if (size != ImageSize{next.width, next.height} || from.intrinsics.model != to.intrinsics.model)
        return fail(ErrorCode::usage, "sr_world_flow: both pictures must have one size and one camera model");
    SR_CHECK(show_updates(world, true));
    from.camera = to.camera = // memory and programs are of a kind
        fmt::format("{} x {} {}", size.width, size.height, name_of(from.intrinsics.model));
    FlowDrawing& drawing = flow_of(world);
    drawing.forget(); // splats and actors may be others than those of the last call
    SR_TRY(const FlowSlots made, drawing.flow(from, to));
    std::vector<WantedPicture> wanted;
    if (want_flow)
        wanted.push_back({made.flow.slice(), flow, size});
    if (want_states)
        wanted.push_back({made.states.slice(), states, size});
    return hand_over(*world.context, wanted);
}

} // namespace

sr_status sr_world_flow(sr_world* world, const sr_draw_desc* now, const sr_draw_desc* next, const sr_target* flow,
                        const sr_target* states)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "sr_world_flow: world is NULL");
        SR_TRY(const sr_draw_desc known_now, read_struct(now, "sr_draw_desc"));
        SR_TRY(const sr_draw_desc known_next, read_struct(next, "sr_draw_desc"));
        return draw_flow(*world, known_now, known_next, flow, states);
    });
}

static_assert(SR_FLOW_NOTHING == uint32_t(FlowState::nothing) && SR_FLOW_SEEN == uint32_t(FlowState::seen));
static_assert(SR_FLOW_HIDDEN == uint32_t(FlowState::hidden) && SR_FLOW_OUTSIDE == uint32_t(FlowState::outside));
