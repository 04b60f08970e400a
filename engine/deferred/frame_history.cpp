// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/frame_history.h"

#include "engine/splat/camera_pair.h"
#include "kernels/picture.h"

#include <algorithm>

namespace semrover {

namespace {

std::vector<float> metres_of(const DepthPicture& depth)
{
    std::vector<float> metres(depth.pixels.size());
    std::ranges::transform(depth.pixels, metres.begin(),
                           [unit = float(depth.unit)](uint32_t d) { return float(d) * unit; });
    return metres;
}

} // namespace

FrameHistory::Memory::Memory(const LatentSize& latent_size) : size(latent_size)
{
    const uint32_t pixels = size.image_width * size.image_height;
    const auto words = [&](uint32_t count, const char* name) { return state.tensor(count, 1, DType::u32, name, 1); };
    const auto bytes = [&](const char* name) {
        return words(picture_words(size.image_width, size.image_height), name);
    };
    cameras = state.tensor(2, kLensCameraFloats, DType::f32, "cameras", kLensCameraFloats);
    const auto depths = [&](const char* name) { return state.tensor(pixels, 1, DType::f32, name, 1); };
    now = {bytes("frame"), depths("depth")};
    past = {bytes("frame before"), depths("depth before")};
    made = bytes("accumulated frame");
}

Graph FrameHistory::Memory::graph(const DeviceLimits& limits, SplatLens lens, bool moving, float share) const
{
    Graph g(limits);
    const AccumulateOptions options{
        .width = size.image_width, .height = size.image_height, .lens = lens, .moving = moving, .share = share};
    g.keep(
        accumulate(g, cameras.in(g), {now.bytes.in(g), now.depth.in(g)}, {past.bytes.in(g), past.depth.in(g)}, options),
        made);
    return g;
}

Result<std::unique_ptr<FrameHistory>> FrameHistory::create(Device& device, const LatentSize& size, CameraModel model,
                                                           float share)
{
    std::unique_ptr<FrameHistory> h(new FrameHistory(device, size, share));
    SR_CHECK(h->memory_.state.allocate(device, "the frame before"));
    SR_TRY(h->copies_, CopyRing::create(device));
    SR_CHECK(h->use_lens(model, false));
    return h;
}

Status FrameHistory::use_lens(CameraModel model, bool moving)
{
    if (executable_ && model_ == model && moving_ == moving)
        return {};
    SR_TRY(executable_, Executable::create(device_, memory_.graph(device_.limits(), lens_of(model), moving, share_)));
    model_ = model;
    moving_ = moving;
    return {};
}

uint64_t FrameHistory::planned_bytes(const DeviceLimits& limits, const LatentSize& size)
{
    return Memory(size).state.planned_bytes(limits);
}

Status FrameHistory::copy(const DeviceTensor& from, const DeviceTensor& to)
{
    return copies_->copy(from, to).map([](uint64_t) {});
}

Status FrameHistory::add(const DeviceTensor& bytes, const CameraFrame& camera, const DepthPicture& depth)
{
    SR_CHECK(copy(bytes, memory_.now.bytes));
    return accumulate_now(camera, depth);
}

Status FrameHistory::add(std::span<const uint8_t> pixels, const CameraFrame& camera, const DepthPicture& depth)
{
    SR_CHECK(write_pixels(pixels));
    return accumulate_now(camera, depth);
}

// to the words of the frame; the last one may lie beyond the pixels
Status FrameHistory::write_pixels(std::span<const uint8_t> pixels)
{
    std::vector<uint8_t> words(pixels.begin(), pixels.end());
    words.resize(memory_.now.bytes.bytes());
    return memory_.now.bytes.write(device_, words);
}

Status FrameHistory::accumulate_now(const CameraFrame& camera, const DepthPicture& depth)
{
    const bool alone = frames_ == 0 || camera.intrinsics.model != camera_.intrinsics.model;
    added_ = camera;
    if (frames_ > 0 && !before_) {
        SR_CHECK(copy(memory_.made, memory_.past.bytes));
        SR_CHECK(copy(memory_.now.depth, memory_.past.depth));
        before_ = true;
    }
    SR_CHECK(memory_.now.depth.write(device_, metres_of(depth)));
    if (alone)
        return copy(memory_.now.bytes, memory_.made);
    const CameraPair pair = pair_of(camera, camera_);
    SR_CHECK(memory_.cameras.write(device_, pair.rows));
    SR_CHECK(use_lens(pair.model, pair.moving));
    return executable_->run();
}

void FrameHistory::keep()
{
    camera_ = std::move(added_);
    ++frames_;
    before_ = false;
}

void FrameHistory::restart()
{
    frames_ = 0;
    before_ = false;
}

Status FrameHistory::restore(std::span<const uint8_t> pixels, const CameraFrame& camera, const DepthPicture& depth)
{
    restart();
    SR_CHECK(add(pixels, camera, depth));
    keep();
    return {};
}

} // namespace semrover
