// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/video_decoder.h"

#include "engine/refine/frame_slots.h"
#include "kernels/picture.h"

namespace semrover {

struct VideoDecoder::Ends {
    const VaeConfig& config;
    LatentSize size;
    uint32_t frames, latent_rows, image_rows;
    State state;
    Slot latents, images;

    Ends(const Vae& vae, const LatentSize& latent_size, uint32_t frame_count)
        : config(vae.config()), size(latent_size), frames(frame_count),
          latent_rows(round_up(size.pixels(), kImageRowPadding)),
          image_rows(round_up(size.pixels() * size.downscale * size.downscale, kImageRowPadding)),
          latents(state.slot(frames * latent_rows, config.latent_channels, DType::f32, "latents")),
          images(state.slot(frames * image_rows, config.out_channels, DType::f32, "pictures"))
    {
    }
    Graph graph(const Vae& vae) const
    {
        Graph g;
        const Tensor z = latents.in(g);
        const LatentScale scale{config.scaling_factor, config.shift_factor, true};
        const Tensor unscaled = scale_latent(g, z, z.rows, config.latent_channels, scale);
        const FeatureMap y = vae.decode(g, {unscaled, frames, size.height(), size.width()});
        SR_ASSERT(y.image_rows() == image_rows && y.channels() == config.out_channels, "the VAE gives {} x {}",
                  y.height, y.width);
        g.keep(y.data, images);
        return g;
    }
};

VideoDecoder::VideoDecoder(Device& device, std::unique_ptr<Ends> ends) : device_(device), ends_(std::move(ends)) {}
VideoDecoder::~VideoDecoder() = default;

Result<std::unique_ptr<VideoDecoder>> VideoDecoder::create(Device& device, const Vae& vae, const LatentSize& size,
                                                           uint32_t frames)
{
    std::unique_ptr<VideoDecoder> d(new VideoDecoder(device, std::make_unique<Ends>(vae, size, frames)));
    SR_CHECK(d->ends_->state.allocate(device, "pictures and latents of a video"));
    SR_TRY(d->program_, Program::create(device, d->ends_->graph(vae)));
    return d;
}

Result<uint64_t> VideoDecoder::planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                             uint32_t frames)
{
    const Ends ends(vae, size, frames);
    SR_TRY(const Plan plan, make_plan(ends.graph(vae).desc(), limits));
    return ends.state.planned_bytes(limits) + plan.arena_bytes();
}

Result<std::vector<float>> VideoDecoder::decode(std::span<const float> latents)
{
    const Ends& e = *ends_;
    const size_t latent = size_t(e.size.pixels()) * e.latents.cols(), channels = e.images.cols();
    SR_ASSERT(latents.size() == e.frames * latent, "{} numbers to decode", latents.size());
    SR_CHECK(write_frames(device_, e.latents, e.frames, latents));
    SR_CHECK(program_->run());
    const uint32_t line = e.size.width() * e.size.downscale; // pixels of one, padding included
    SR_TRY(const auto lines, read_frames(device_, e.images, e.frames, e.size.image_height * line));
    std::vector<float> images;
    for (uint32_t y = 0; y < e.frames * e.size.image_height; ++y) {
        const auto first = lines.begin() + std::ptrdiff_t(size_t(y) * line * channels);
        images.insert(images.end(), first, first + std::ptrdiff_t(e.size.image_width * channels));
    }
    SR_CHECK(check_finite(images, "the decoded video"));
    return images;
}

} // namespace semrover
