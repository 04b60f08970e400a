// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/frame_renderer.h"

namespace semrover {

FrameRenderer::FrameRenderer(Device& device, std::shared_ptr<LoadedNetworks> networks, const SamplingPlan& plan,
                             AsdOptions options, MemoryPolicy policy)
    : device_(device), plan_(plan), options_(std::move(options)), policy_(policy), networks_(std::move(networks))
{
}
FrameRenderer::~FrameRenderer() = default;

Status FrameRenderer::start(const RendererWork& work, const RendererWork& run)
{
    if (size_ != work.size) {
        asd_.reset();
        codec_.reset();
        size_ = work.size;
    }
    if (policy_ == MemoryPolicy::staged)
        return {};
    if (run.encode || run.decode)
        SR_CHECK(networks_.vae());
    if (run.denoise)
        SR_CHECK(networks_.unet());
    if (!work.denoise || asd_)
        return {};
    codec_.reset();
    SR_CHECK(make_asd());
    return {};
}

Status FrameRenderer::compile()
{
    SR_CHECK(codec(CodecDirection::encode));
    SR_CHECK(make_way(Part::denoise));
    SR_CHECK(make_denoiser());
    SR_CHECK(asd_->make_programs());
    return codec(CodecDirection::decode).map([](LatentCodec*) {});
}

Status FrameRenderer::make_way(Part part)
{
    const bool coding = part != Part::denoise;
    const CodecDirection wanted = part == Part::decode ? CodecDirection::decode : CodecDirection::encode;
    if (codec_ && (!coding || direction_ != wanted))
        codec_.reset();
    if (coding && asd_)
        asd_->rest();
    if (policy_ == MemoryPolicy::resident)
        return {};
    if (coding) {
        asd_.reset();
        networks_.drop_unet();
    } else {
        networks_.drop_vae();
    }
    return {};
}

Status FrameRenderer::make_asd()
{
    if (asd_)
        return {};
    const Conditioning text{networks_.model().conditioning_tokens, networks_.model().conditioning};
    SR_TRY(const Unet* unet, networks_.unet());
    SR_TRY(asd_, AsdRenderer::create(device_, *unet, plan_, text, size_, options_));
    return {};
}

Result<LatentCodec*> FrameRenderer::codec(CodecDirection direction)
{
    SR_CHECK(make_way(direction == CodecDirection::encode ? Part::encode : Part::decode));
    SR_TRY(const Vae* vae, networks_.vae());
    if (!codec_) {
        SR_TRY(codec_, LatentCodec::create(device_, *vae, size_, direction));
        direction_ = direction;
    }
    return codec_.get();
}

Result<std::vector<float>> FrameRenderer::encode(std::span<const float> image)
{
    SR_TRY(LatentCodec * c, codec(CodecDirection::encode));
    return c->encode(image);
}

Status FrameRenderer::begin(const AsdFrame& frame)
{
    SR_CHECK(make_way(Part::denoise));
    SR_CHECK(make_asd());
    return asd_->begin(frame);
}

Result<bool> FrameRenderer::step(size_t submits)
{
    SR_ASSERT(asd_, "a step of a frame that has not begun");
    return asd_->step(submits);
}

Result<std::vector<float>> FrameRenderer::finish()
{
    SR_ASSERT(asd_, "a frame is finished that has not begun");
    return asd_->finish();
}

Status FrameRenderer::cancel()
{
    return asd_ ? asd_->cancel() : Status{};
}

Result<std::vector<float>> FrameRenderer::decode(std::span<const float> latent)
{
    SR_TRY(LatentCodec * c, codec(CodecDirection::decode));
    return c->decode(latent);
}

Status FrameRenderer::copy(const Slot& from, const Slot& to)
{
    if (!copies_) {
        SR_TRY(copies_, CopyRing::create(device_));
    }
    return copies_->copy(from, to).map([](uint64_t) {});
}

// where the latents lie, before there is anything to denoise
Status FrameRenderer::make_denoiser()
{
    SR_ASSERT(policy_ == MemoryPolicy::resident, "latents stay on the device under the resident policy only");
    return make_asd();
}

// to the denoiser, with what is visible
Status FrameRenderer::encoded(const LatentCodec& codec)
{
    SR_CHECK(codec.check());
    SR_CHECK(copy(codec.slots().latent, asd_->slots().buffer));
    return copy(codec.slots().shares, asd_->slots().visible);
}

Status FrameRenderer::encode_seen(const Slot& seen)
{
    SR_CHECK(make_denoiser());
    SR_TRY(LatentCodec * c, codec(CodecDirection::encode));
    SR_CHECK(copy(seen, c->slots().seen));
    SR_CHECK(c->encode_seen());
    return encoded(*c);
}

Status FrameRenderer::encode_seen(std::span<const uint32_t> seen)
{
    SR_CHECK(make_denoiser());
    SR_TRY(LatentCodec * c, codec(CodecDirection::encode));
    SR_CHECK(c->slots().seen.write(device_, seen));
    SR_CHECK(c->encode_seen());
    return encoded(*c);
}

Status FrameRenderer::use_latent(std::span<const float> buffer, std::span<const float> visible)
{
    SR_CHECK(make_denoiser());
    SR_CHECK(asd_->slots().buffer.write_rows(device_, buffer));
    return asd_->slots().visible.write_rows(device_, visible);
}

Status FrameRenderer::use_previous(std::span<const float> latent)
{
    SR_CHECK(make_denoiser());
    return asd_->slots().latent.write_rows(device_, latent);
}

Status FrameRenderer::begin_frame(const AsdStart& frame)
{
    SR_CHECK(make_way(Part::denoise));
    SR_CHECK(make_denoiser());
    if (!frame.first)
        SR_CHECK(copy(asd_->slots().latent, asd_->slots().previous));
    return asd_->begin(frame);
}

Status FrameRenderer::end_frame()
{
    return asd_->end();
}

Result<Slot> FrameRenderer::decode_latent()
{
    const AsdSlots& made = asd_->slots();
    SR_TRY(LatentCodec * c, codec(CodecDirection::decode));
    SR_CHECK(copy(made.latent, c->slots().latent));
    SR_CHECK(c->decode_latent());
    SR_CHECK(c->check());
    return c->slots().bytes;
}

} // namespace semrover
