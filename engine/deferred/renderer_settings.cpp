// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/renderer_settings.h"

#include "runtime/base/quote.h"
#include "runtime/base/result.h"

#include <algorithm>

namespace semrover {

namespace {

// a renderer that makes each frame from the one before
Status settle_frames(RendererSettings& r, const RendererModel& model, const RendererOptions& o)
{
    if (o.first_guidance_scale || o.window_frames || o.window_overlap || o.decode_frames)
        return fail(ErrorCode::usage, "{}: this renderer makes frames one by one, and has no windows of them",
                    quote_path(model.folder));
    r.asd.guidance_scale = o.guidance_scale.value_or(model.defaults.guidance_scale);
    r.asd.previous_noise = o.previous_noise.value_or(model.defaults.previous_noise);
    r.asd.seed = o.seed;
    r.frame_history = o.frame_history.value_or(model.defaults.frame_history);
    if (!(r.frame_history >= 0 && r.frame_history <= kMostFrameHistory))
        return fail(ErrorCode::usage, "a share of {} of the frame before, expected 0 to {}", r.frame_history,
                    kMostFrameHistory);
    return {};
}

// one that makes windows of frames
Status settle_windows(RendererSettings& r, const RendererModel& model, const RendererOptions& o)
{
    const VideoDefaults& d = model.defaults.video;
    if (o.previous_noise)
        return fail(ErrorCode::usage, "{}: a renderer of videos puts no noise on the frame before",
                    quote_path(model.folder));
    if (o.frame_history.value_or(0) > 0)
        return fail(ErrorCode::usage, "{}: a renderer of videos takes no share of the frame before",
                    quote_path(model.folder));
    r.vsd.first_guidance = o.first_guidance_scale.value_or(d.first_guidance_scale);
    r.vsd.last_guidance = o.guidance_scale.value_or(model.defaults.guidance_scale);
    r.vsd.correlation = d.frame_correlation;
    r.vsd.seed = o.seed;
    WindowShape& s = r.shape;
    s.frames = o.window_frames.value_or(d.window_frames);
    if (s.frames < 1 || s.frames > kMostWindowFrames)
        return fail(ErrorCode::usage, "a window of {} frames, expected 1 to {}", s.frames, kMostWindowFrames);
    s.overlap = o.window_overlap.value_or(std::min(d.window_overlap, s.frames - 1));
    if (s.overlap >= s.frames)
        return fail(ErrorCode::usage, "windows of {} frames cannot overlap by {}", s.frames, s.overlap);
    s.decode_frames = std::min(o.decode_frames.value_or(d.decode_frames), s.frames);
    if (s.decode_frames < 1)
        return fail(ErrorCode::usage, "no frame is decoded at a time, expected 1 or more");
    return {};
}

} // namespace

std::vector<FrameWindow> frame_windows(const FrameRange& range, uint32_t before, uint32_t length, uint32_t overlap)
{
    SR_ASSERT(overlap < length && before <= range.first, "windows of {} frames that overlap by {}, {} frames before {}",
              length, overlap, before, range.first);
    const uint32_t lowest = range.first - before, end = range.last + 1;
    std::vector<FrameWindow> windows;
    for (uint32_t next = range.first; next < end;) {
        uint32_t first = next - std::min(overlap, next - lowest);
        if (first + length > end)
            first = std::max(lowest, end - std::min(length, end));
        const uint32_t count = std::min(length, end - first);
        windows.push_back({first, count, next - first});
        next = first + count;
    }
    return windows;
}

std::vector<FrameWindow> decode_windows(const FrameWindow& window, uint32_t length)
{
    constexpr uint32_t kOverlap = 1; // frames that a decoder of videos sees before those that are kept
    return frame_windows({window.next(), window.end() - 1}, window.known, length, std::min(kOverlap, length - 1));
}

Result<RendererSettings> settle_renderer(const RendererModel& model, const RendererOptions& o)
{
    RendererSettings r;
    r.steps = o.steps.value_or(model.defaults.num_inference_steps);
    r.frame_noise = o.frame_noise.value_or(model.defaults.frame_noise);
    SR_CHECK(model.video() ? settle_windows(r, model, o) : settle_frames(r, model, o));
    SR_TRY(r.plan, plan_sampling(model.scheduler, r.steps));
    return r;
}

} // namespace semrover
