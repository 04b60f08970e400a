// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/window_renderer.h"

namespace semrover {

WindowRenderer::WindowRenderer(Device& device, std::shared_ptr<LoadedNetworks> networks, const SamplingPlan& plan,
                               VsdOptions options, MemoryPolicy policy)
    : device_(device), plan_(plan), options_(std::move(options)), policy_(policy), networks_(std::move(networks))
{
    options_.halves_apart = policy == MemoryPolicy::staged;
}
WindowRenderer::~WindowRenderer() = default;

Status WindowRenderer::start(const RendererWork& work, const RendererWork& run)
{
    if (!work_.same_shapes(work)) {
        vsd_.reset();
        encoder_.reset();
        decoder_.reset();
    }
    work_ = work;
    if (policy_ == MemoryPolicy::staged)
        return {};
    if (run.encode || run.decode)
        SR_CHECK(networks_.vae());
    if (run.denoise)
        SR_CHECK(networks_.unet());
    if (!work.denoise || vsd_)
        return {};
    encoder_.reset();
    decoder_.reset();
    return make_vsd();
}

Status WindowRenderer::make_way(Part part)
{
    if (part != Part::encode)
        encoder_.reset();
    if (part != Part::decode)
        decoder_.reset();
    const bool coding = part != Part::denoise;
    if (coding && vsd_)
        vsd_->rest();
    if (policy_ == MemoryPolicy::resident)
        return {};
    if (coding) {
        vsd_.reset();
        networks_.drop_unet();
    } else {
        networks_.drop_vae();
    }
    return {};
}

Status WindowRenderer::make_vsd()
{
    if (vsd_)
        return {};
    const VideoConditioning conditioning{{networks_.model().conditioning_tokens, networks_.model().conditioning},
                                         networks_.model().defaults.video.added_numbers};
    SR_TRY(const Unet* unet, networks_.unet());
    SR_TRY(vsd_, VsdRenderer::create(device_, *unet, plan_, conditioning, work_.size, work_.frames, options_));
    return {};
}

Result<EncodedBuffer> WindowRenderer::encode(std::span<const uint32_t> seen)
{
    SR_CHECK(make_way(Part::encode));
    SR_TRY(const Vae* vae, networks_.vae());
    if (!encoder_) {
        SR_TRY(encoder_, LatentCodec::create(device_, *vae, work_.size, CodecDirection::encode_unscaled));
    }
    const CodecSlots& s = encoder_->slots();
    SR_CHECK(s.seen.write(device_, seen));
    SR_CHECK(encoder_->encode_seen());
    SR_CHECK(encoder_->check());
    EncodedBuffer encoded;
    SR_TRY(encoded.latent, s.latent.read_rows(device_, work_.size.pixels()));
    SR_TRY(encoded.visible, s.shares.read_rows(device_, work_.size.pixels()));
    return encoded;
}

Status WindowRenderer::begin(const VsdWindow& window)
{
    SR_CHECK(make_way(Part::denoise));
    SR_CHECK(make_vsd());
    return vsd_->begin(window);
}

Result<bool> WindowRenderer::step(size_t submits)
{
    SR_ASSERT(vsd_, "a step of a window that has not begun");
    return vsd_->step(submits);
}

Result<std::vector<float>> WindowRenderer::finish()
{
    SR_ASSERT(vsd_, "a window is finished that has not begun");
    return vsd_->finish();
}

Status WindowRenderer::cancel()
{
    return vsd_ ? vsd_->cancel() : Status{};
}

Result<const VideoDecoder*> WindowRenderer::decode(std::span<const float> latents)
{
    SR_CHECK(make_way(Part::decode));
    SR_TRY(const Vae* vae, networks_.vae());
    if (!decoder_) {
        SR_TRY(decoder_, VideoDecoder::create(device_, *vae, work_.size, work_.decode_frames));
    }
    SR_CHECK(decoder_->decode_bytes(latents));
    return decoder_.get();
}

} // namespace semrover
