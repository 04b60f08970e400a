// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/frame_chain.h"

#include "kernels/picture.h"

#include <cstring>

namespace semrover {

namespace {

// color and visibility of words as splat_pixels() makes them
struct SeenBytes {
    std::vector<uint8_t> color, visible;

    explicit SeenBytes(std::span<const uint32_t> words)
    {
        for (const uint32_t word : words) {
            for (const int shift : {0, 8, 16})
                color.push_back(uint8_t(word >> shift));
            visible.push_back(uint8_t(word >> 24));
        }
    }
};

} // namespace

FrameChain::FrameChain(Device& device, Refinement renderer, const ImageSize& size, const std::string& camera)
    : device_(device), r_(std::move(renderer)), size_{size.width, size.height, r_.model.vae.downscale()},
      key_(chain_key(camera)), trail_(size_), next_trail_(size_)
{
    const uint32_t pixels = size.width * size.height;
    seen_ = state_.slot(pixels, 1, DType::u32, "seen", 1);
    if (follows_surfaces())
        depths_ = state_.slot(divide_up(pixels, 2), 1, DType::u32, "depths", 1);
    bytes_ = state_.slot(picture_words(size.width, size.height), 1, DType::u32, "bytes", 1);
    texels_ = state_.slot(pixels, 1, DType::u32, "texels", 1);
    last_ = state_.slot(round_up(size_.pixels(), kImageRowPadding), r_.model.vae.latent_channels, DType::f32,
                        "latent of the frame before");
}

Result<std::unique_ptr<FrameChain>> FrameChain::create(Device& device, std::shared_ptr<LoadedNetworks> networks,
                                                       Refinement renderer, const ImageSize& size,
                                                       const std::string& camera)
{
    if (renderer.model.video())
        return fail(ErrorCode::usage, "a chain makes frames one by one; this renderer makes windows of them");
    if (size.width < 1 || size.height < 1 || size.width > kMaxImageSide || size.height > kMaxImageSide)
        return fail(ErrorCode::usage, "frames of {} x {} pixels; 1 to {} are possible", size.width, size.height,
                    kMaxImageSide);
    std::unique_ptr<FrameChain> chain(new FrameChain(device, std::move(renderer), size, camera));
    SR_CHECK(chain->make(std::move(networks)));
    return chain;
}

Status FrameChain::make(std::shared_ptr<LoadedNetworks> networks)
{
    const RendererWork work{.size = size_};
    const uint64_t history = r_.frame_history > 0 ? FrameHistory::planned_bytes(device_.limits(), size_) : 0;
    const uint64_t beside = state_.planned_bytes(device_.limits()) + history;
    SR_TRY(memory_, plan_renderer(device_, r_, {&work, 1}, beside, networks->loaded()));
    SR_CHECK(state_.allocate(device_, "a chain's pictures"));
    if (r_.frame_history > 0) {
        SR_TRY(history_, FrameHistory::create(device_, size_, CameraModel::pinhole, r_.frame_history));
    }
    SR_TRY(copies_, CopyRing::create(device_));
    Graph g;
    g.keep(picture_texels(g, bytes_.in(g), size_.image_width * size_.image_height), texels_);
    SR_TRY(to_texels_, Program::create(device_, g));
    renderer_ = std::make_unique<FrameRenderer>(device_, std::move(networks), r_.plan, r_.asd, memory_.policy);
    SR_CHECK(renderer_->start(work, work));
    return resident() ? renderer_->compile() : Status{};
}

Status FrameChain::fill(const Slot& seen)
{
    return copies_->copy(seen, seen_).map([](uint64_t) {});
}

Status FrameChain::begin(const CameraFrame& camera, const ImageGray16& depth)
{
    SR_ASSERT(!busy(), "a frame begins before the one before has ended");
    if (warped()) {
        next_trail_ = trail_;
        next_trail_.follow(camera, depth);
    }
    if (history_) {
        camera_ = camera;
        depth_ = depth;
    }
    stage_ = Stage::encode;
    return {};
}

AsdStart FrameChain::start() const
{
    return {frames_, key_, frames_ == 0, warped() ? next_trail_.keys() : std::span<const NoiseKey>{}};
}

Status FrameChain::encode()
{
    const AsdStart start = this->start();
    if (resident()) {
        SR_CHECK(renderer_->encode_seen(seen_));
        if (!start.first) // which a frame that was given up may have replaced
            SR_CHECK(copies_->copy(last_, renderer_->denoiser()->slots().latent).map([](uint64_t) {}));
        return renderer_->begin_frame(start);
    }
    SR_TRY(const std::vector<uint32_t> words, seen_.read<uint32_t>(device_));
    const SeenBytes buffer(words);
    SR_TRY(const std::vector<float> latent, renderer_->encode(floats_of_pixels(buffer.color)));
    const std::vector<float> visible = block_shares(size_, buffer.visible);
    const std::span<const float> before = start.first ? std::span<const float>{} : last_on_host_;
    return renderer_->begin({start.number, start.chain, latent, visible, before, start.keys});
}

Status FrameChain::denoise()
{
    SR_TRY(const bool done, renderer_->step(1));
    if (!done)
        return {};
    stage_ = Stage::decode;
    if (resident())
        return renderer_->end_frame();
    SR_TRY(new_latent_, renderer_->finish());
    return {};
}

Status FrameChain::decode()
{
    if (resident()) {
        SR_TRY(const Slot bytes, renderer_->decode_latent());
        SR_CHECK(copies_->copy(bytes, bytes_).map([](uint64_t) {}));
    } else {
        SR_TRY(const std::vector<float> image, renderer_->decode(new_latent_));
        std::vector<uint8_t> bytes = pixels_of_floats(image);
        bytes.resize(bytes_.bytes());
        SR_CHECK(bytes_.write(device_, bytes));
    }
    if (history_) {
        SR_CHECK(history_->add(bytes_, camera_, depth_));
        SR_CHECK(copies_->copy(history_->frame(), bytes_).map([](uint64_t) {}));
    }
    SR_CHECK(to_texels_->run());
    return keep_latent();
}

// the frame is done: the next one follows it
Status FrameChain::keep_latent()
{
    if (resident())
        SR_CHECK(copies_->copy(renderer_->denoiser()->slots().latent, last_).map([](uint64_t) {}));
    else
        last_on_host_ = std::move(new_latent_);
    if (warped())
        trail_ = next_trail_;
    ++frames_;
    stage_ = Stage::idle;
    return {};
}

// one piece of work of the stage that the frame is in
Status FrameChain::submit()
{
    switch (stage_) {
    case Stage::encode:
        SR_CHECK(encode());
        stage_ = Stage::denoise;
        return {};
    case Stage::denoise:
        return denoise();
    case Stage::decode:
        return decode();
    case Stage::idle:
        break;
    }
    return {};
}

Result<bool> FrameChain::step(const JobBudget& budget)
{
    SR_ASSERT(busy(), "a step of a frame that has not begun");
    BudgetMeter meter(budget);
    do {
        SubmitCost& cost = cost_[size_t(stage_) - 1];
        Status done = submit();
        if (done && budget.timed())
            done = device_.wait(device_.last_ticket());
        if (!done) {
            (void)cancel(); // of two errors the first one counts
            return tl::make_unexpected(std::move(done).error());
        }
        meter.spent(cost, true);
    } while (busy() && meter.room_for(cost_[size_t(stage_) - 1].bound()));
    return !busy();
}

Status FrameChain::cancel()
{
    const bool denoising = stage_ == Stage::denoise;
    stage_ = Stage::idle;
    return denoising ? renderer_->cancel() : Status{};
}

void FrameChain::restart()
{
    SR_ASSERT(!busy(), "a chain restarts in the middle of a frame");
    frames_ = 0;
    trail_ = NoiseTrail(size_);
    if (history_)
        history_->restart();
}

} // namespace semrover
