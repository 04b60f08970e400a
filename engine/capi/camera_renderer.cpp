// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/camera_renderer.h"

#include "kernels/picture.h"

namespace semrover {

CameraRenderer::CameraRenderer(Device& device, const LatentSize& size, const RendererSettings& settings,
                               const std::string& camera)
    : device_(device)
{
    chain_.name = camera;
    chain_.work.size = size;
    chain_.warped_noise = settings.frame_noise == FrameNoise::warped;
    chain_.history = settings.frame_history;
    const uint32_t pixels = size.image_width * size.image_height;
    seen_ = state_.tensor(pixels, 1, DType::u32, "seen", 1);
    if (settings.follows_surfaces())
        depths_ = state_.tensor(divide_up(pixels, 2), 1, DType::u32, "depths", 1);
    bytes_ = state_.tensor(picture_words(size.image_width, size.image_height), 1, DType::u32, "bytes", 1);
    texels_ = state_.tensor(pixels, 1, DType::u32, "texels", 1);
}

Result<std::unique_ptr<CameraRenderer>> CameraRenderer::create(Device& device, std::shared_ptr<LoadedNetworks> networks,
                                                               RendererSettings settings, const ImageSize& size,
                                                               const std::string& camera)
{
    const RendererModel& model = networks->model();
    if (model.video())
        return fail(ErrorCode::usage, "a camera's frames are made one by one; this renderer makes windows of them");
    const LatentSize latent{size.width, size.height, model.vae.downscale()};
    std::unique_ptr<CameraRenderer> r(new CameraRenderer(device, latent, settings, camera));
    SR_CHECK(r->make(std::move(networks), std::move(settings)));
    return r;
}

Status CameraRenderer::make(std::shared_ptr<LoadedNetworks> networks, RendererSettings settings)
{
    const LatentSize& size = chain_.size();
    const uint64_t history = chain_.history > 0 ? FrameHistory::planned_bytes(device_.limits(), size) : 0;
    SR_TRY(MemoryPlan plan, plan_renderer(device_, *networks, settings, {&chain_.work, 1},
                                          state_.planned_bytes(device_.limits()) + history));
    SR_CHECK(state_.allocate(device_, "a camera's pictures"));
    SR_TRY(copies_, CopyRing::create(device_));
    Graph g(device_.limits());
    g.keep(picture_texels(g, bytes_.in(g), size.image_width * size.image_height), texels_);
    SR_TRY(to_texels_, Executable::create(device_, g));
    const CameraChain* chain = &chain_;
    SR_TRY(renderer_, DeferredRenderer::create(device_, std::move(networks), std::move(settings), std::move(plan),
                                               {&chain, 1}, *this));
    return {};
}

Status CameraRenderer::fill(const DeviceTensor& seen)
{
    return copies_->copy(seen, seen_).map([](uint64_t) {});
}

Status CameraRenderer::read_seen(const CameraChain&, uint32_t, const DeviceTensor& to)
{
    return copies_->copy(seen_, to).map([](uint64_t) {});
}

Result<FrameView> CameraRenderer::view(const CameraChain&, uint32_t frame)
{
    SR_ASSERT(frame == frames_, "the view of frame {} is not there, frame {} is at work", frame, frames_);
    return view_;
}

Status CameraRenderer::save_frame(const CameraChain&, uint32_t, const DeviceTensor& pixels)
{
    SR_CHECK(copies_->copy(pixels, bytes_).map([](uint64_t) {}));
    return to_texels_->run();
}

Status CameraRenderer::begin(FrameView view)
{
    SR_ASSERT(!busy_, "a frame begins before the one before has ended");
    view_ = std::move(view);
    part_ = FramePart::encode;
    busy_ = true;
    return {};
}

Result<bool> CameraRenderer::step(const JobBudget& budget)
{
    SR_ASSERT(busy_, "a step of a frame that has not begun");
    BudgetMeter meter(budget);
    const FrameWindow frame{frames_, 1, 0};
    do {
        const FramePart part = part_;
        auto done = unless_memory_is_short([&] { return renderer_->step({part, &chain_, frame, frame}); });
        if (done && budget.timed())
            done = device_.wait(device_.last_ticket()).map([&] { return *done; });
        if (!done) {
            (void)cancel(); // of two errors the first one counts
            return done;
        }
        busy_ = !*done || part != FramePart::decode;
        if (*done && busy_)
            part_ = FramePart(int(part) + 1);
        meter.spent(cost_[int(part)], true);
    } while (busy_ && meter.room_for(cost_[int(part_)].bound()));
    frames_ += !busy_;
    return !busy_;
}

Status CameraRenderer::cancel()
{
    if (!std::exchange(busy_, false))
        return {};
    const Status cancelled = renderer_->cancel();
    renderer_->forget(chain_, frames_);
    return cancelled;
}

void CameraRenderer::restart()
{
    SR_ASSERT(!busy_, "a camera restarts in the middle of a frame");
    frames_ = 0;
    renderer_->forget(chain_, 0);
}

} // namespace semrover
