// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/refiner.h"

#include "tools/view/figures.h"

namespace semrover::view {

Refiner::~Refiner()
{
    sr_renderer_destroy(renderer_);
    sr_model_destroy(model_);
}

Status Refiner::open(uint32_t width, uint32_t height)
{
    if (renderer_ && width == width_ && height == height_)
        return {};
    sr_renderer_destroy(renderer_);
    renderer_ = nullptr;
    if (!model_) {
        SR_TRY(model_, load_model(context_, request_.model, SR_MODEL_RENDERER));
    }
    sr_renderer_desc desc{};
    desc.struct_size = sizeof desc;
    desc.steps = request_.steps;
    desc.model = model_;
    desc.width = width_ = width;
    desc.height = height_ = height;
    desc.seed = request_.seed;
    desc.noise = SR_NOISE_FRESH; // a frame alone: its picture does not depend on those before
    SR_CHECK(checked(sr_renderer_create(context_, &desc, &renderer_), context_));
    sr_renderer_info info{};
    info.struct_size = sizeof info;
    SR_CHECK(checked(sr_renderer_get_info(renderer_, &info), context_));
    steps_ = info.steps;
    return {};
}

Status Refiner::begin(const Street& street, const Camera& camera, const Picture& picture)
{
    cancel();
    SR_CHECK(open(picture.width(), picture.height()));
    SR_CHECK(checked(sr_renderer_restart(renderer_), context_));
    sr_frame_desc frame{};
    frame.struct_size = sizeof frame;
    frame.world = street.world();
    sr_draw_desc draw{};
    draw.width = picture.width();
    draw.height = picture.height();
    camera.aim(draw);
    frame.fx = draw.fx;
    frame.fy = draw.fy;
    frame.cx = draw.cx;
    frame.cy = draw.cy;
    std::copy_n(draw.world_to_camera, 12, frame.world_to_camera);
    SR_CHECK(checked(sr_renderer_begin(renderer_, &frame), context_));
    busy_ = true;
    return {};
}

Result<bool> Refiner::step(uint64_t budget_us, const Picture& picture)
{
    const Stopwatch watch;
    uint32_t done = 0;
    if (const Status status = checked(sr_renderer_step(renderer_, budget_us, &done), context_); !status) {
        busy_ = false;
        return tl::make_unexpected(status.error());
    }
    step_ms_ = watch.ms();
    if (!done)
        return false;
    busy_ = false;
    const sr_target target = picture.refined();
    SR_CHECK(checked(sr_renderer_take(renderer_, &target), context_));
    return true;
}

void Refiner::cancel()
{
    if (busy_)
        sr_renderer_cancel(renderer_);
    busy_ = false;
}

} // namespace semrover::view
