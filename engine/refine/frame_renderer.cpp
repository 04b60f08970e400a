// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/frame_renderer.h"

namespace semrover {

FrameRenderer::FrameRenderer(Device& device, const RendererModel& model, const SamplingPlan& plan, DType precision,
                             AsdOptions options, MemoryPolicy policy)
    : device_(device), model_(model), plan_(plan), precision_(precision), options_(std::move(options)), policy_(policy)
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
        SR_CHECK(load_vae());
    if (run.denoise)
        SR_CHECK(load_unet());
    if (!work.denoise || asd_)
        return {};
    codec_.reset();
    SR_CHECK(make_asd());
    return {};
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
        unet_.reset();
    } else {
        vae_.reset();
    }
    return {};
}

Status FrameRenderer::load_unet()
{
    if (unet_)
        return {};
    SR_TRY(const Checkpoint weights, model_.open_unet());
    SR_TRY(unet_, Unet::load(device_, model_.unet, weights, precision_));
    return {};
}

Status FrameRenderer::load_vae()
{
    if (vae_)
        return {};
    SR_TRY(const Checkpoint weights, model_.open_vae());
    SR_TRY(vae_, Vae::load(device_, model_.vae, weights, precision_));
    return {};
}

Status FrameRenderer::make_asd()
{
    if (asd_)
        return {};
    const Conditioning text{model_.conditioning_tokens, model_.conditioning};
    SR_TRY(asd_, AsdRenderer::create(device_, *unet_, plan_, text, size_, options_));
    return {};
}

Result<LatentCodec*> FrameRenderer::codec(CodecDirection direction)
{
    SR_CHECK(make_way(direction == CodecDirection::encode ? Part::encode : Part::decode));
    SR_CHECK(load_vae());
    if (!codec_) {
        SR_TRY(codec_, LatentCodec::create(device_, *vae_, size_, direction));
        direction_ = direction;
    }
    return codec_.get();
}

Result<std::vector<float>> FrameRenderer::encode(std::span<const float> image)
{
    SR_TRY(LatentCodec * c, codec(CodecDirection::encode));
    return c->encode(image);
}

Result<std::vector<float>> FrameRenderer::denoise(const AsdFrame& frame, const AsdRenderer::StepCallback& callback)
{
    SR_CHECK(make_way(Part::denoise));
    SR_CHECK(load_unet());
    SR_CHECK(make_asd());
    return asd_->render(frame, callback);
}

Result<std::vector<float>> FrameRenderer::decode(std::span<const float> latent)
{
    SR_TRY(LatentCodec * c, codec(CodecDirection::decode));
    return c->decode(latent);
}

} // namespace semrover
