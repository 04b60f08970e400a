// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/path_drawing.h"

namespace semrover {

PathDrawing::PathDrawing(Device& device, const DrawnScene& scene, CameraPath path, const RasterizerOptions& options,
                         bool flow)
    : scene_(scene), path_(std::move(path)), rasterizers_(device, scene, options)
{
    if (!flow)
        return;
    const auto surfaces = std::make_shared<FrameRasterizers>(device, scene, FlowDrawing::surface_options(options));
    flow_.emplace(device, scene.actors, [surfaces](const CameraFrame& frame) { return surfaces->draw(frame); });
    following_ = following_frames(path_);
}

// end of the run of frames from `first` with the same time and of one kind
size_t PathDrawing::end_of_moment(size_t first) const
{
    const CameraFrame& a = path_.frames[first];
    size_t end = first + 1;
    for (; end < path_.frames.size(); ++end) {
        const CameraFrame& b = path_.frames[end];
        if (b.time != a.time || b.camera == a.camera || b.intrinsics.width != a.intrinsics.width ||
            b.intrinsics.height != a.intrinsics.height || b.intrinsics.model != a.intrinsics.model ||
            rasterizers_.moving(b) != rasterizers_.moving(a))
            break;
    }
    return end;
}

Result<SplatImage> PathDrawing::image(const CameraFrame& frame)
{
    SR_TRY(Rasterizer * rasterizer, rasterizers_.of(frame, 1));
    const bool moving = rasterizers_.moving(frame);
    const SplatCamera camera = splat_camera(frame, moving);
    const SplatMovers movers = scene_.actors.seen_by({&frame, 1}, moving);
    SR_TRY(std::vector<SplatImage> images, rasterizer->render({&camera, 1}, movers));
    return std::move(images.front());
}

Status PathDrawing::draw(std::span<const CameraFrame> frames, const Drawn& drawn)
{
    SR_TRY(Rasterizer * rasterizer, rasterizers_.of(frames.front(), uint32_t(frames.size())));
    const bool moving = rasterizers_.moving(frames.front());
    std::vector<SplatCamera> cameras;
    for (const CameraFrame& frame : frames)
        cameras.push_back(splat_camera(frame, moving));
    for (size_t at = 0; at < cameras.size();) {
        const SplatMovers movers = scene_.actors.seen_by(frames.subspan(at), moving);
        SR_TRY(const uint32_t together, rasterizer->draw(std::span(cameras).subspan(at), movers));
        for (uint32_t i = 0; i < together; ++i, ++at)
            SR_CHECK(drawn(frames[at], {rasterizer->pixels(i)}));
    }
    return {};
}

// of a frame of the path
Result<FlowSlots> PathDrawing::flow_of(size_t frame)
{
    if (!flow_ || following_[frame] == total())
        return FlowSlots();
    return flow_->flow(path_.frames[frame], path_.frames[following_[frame]]);
}

std::span<const CameraFrame> PathDrawing::next() const
{
    SR_ASSERT(done_ < total(), "all {} frames are drawn", total());
    return std::span(path_.frames).subspan(done_, end_of_moment(done_) - done_);
}

bool PathDrawing::skip()
{
    done_ += next().size();
    return done_ == total();
}

Result<bool> PathDrawing::step(const Drawn& drawn)
{
    size_t at = done_;
    SR_CHECK(draw(next(), [&](const CameraFrame& frame, FrameSlots slots) -> Status {
        SR_TRY(slots.flow, flow_of(at++));
        return drawn(frame, slots);
    }));
    return skip();
}

} // namespace semrover
