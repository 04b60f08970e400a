// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/video_decoder.h"

#include "engine/refine/frame_slots.h"

namespace semrover {

struct VideoDecoder::Ends {
    const VaeConfig& config;
    LatentSize size;
    PictureShape picture;
    uint32_t frames;
    State state;
    Slot latents, images, bytes, bad; // bytes: of three channels; bad: first_non_finite() of each frame

    Ends(const Vae& vae, const LatentSize& latent_size, uint32_t frame_count)
        : config(vae.config()),
          size(latent_size), picture{size.image_width, size.image_height, size.width() * size.downscale,
                                     size.height() * size.downscale},
          frames(frame_count)
    {
        const auto rows = [&](uint32_t pixels) { return frames * round_up(pixels, kImageRowPadding); };
        latents = state.slot(rows(size.pixels()), config.latent_channels, DType::f32, "latents");
        images =
            state.slot(rows(picture.padded_width * picture.padded_height), config.out_channels, DType::f32, "pictures");
        bad = frame_words(state, frames, 1, "first number that is none");
        if (config.out_channels == 3)
            bytes = frame_words(state, frames, words(), "bytes");
    }
    uint32_t words() const { return picture_words(picture.width, picture.height); }
    Graph graph(const Vae& vae) const
    {
        Graph g;
        const Tensor z = latents.in(g);
        const LatentScale scale{config.scaling_factor, config.shift_factor, true};
        const Tensor unscaled = scale_latent(g, z, z.rows, config.latent_channels, scale);
        const FeatureMap y = vae.decode(g, {unscaled, frames, size.height(), size.width()});
        SR_ASSERT(y.height == picture.padded_height && y.width == picture.padded_width &&
                      y.channels() == config.out_channels,
                  "the VAE gives {} x {}", y.height, y.width);
        const Tensor all = g.keep(y.data, images);
        check_frames(g, images, frames, picture, bad);
        for (uint32_t f = 0; bytes.valid() && f < frames; ++f)
            g.keep(picture_bytes(g, all.row_range(f * y.image_rows(), y.image_rows()), picture),
                   words_of_frame(bytes, frames, f, words()));
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

Status VideoDecoder::decode_bytes(std::span<const float> latents)
{
    const Ends& e = *ends_;
    SR_ASSERT(latents.size() == size_t(e.frames) * e.size.pixels() * e.latents.cols(), "{} numbers to decode",
              latents.size());
    SR_CHECK(write_frames(device_, e.latents, e.frames, latents));
    SR_CHECK(program_->run());
    return check_frame_words(device_, e.bad, e.images, e.frames, e.picture, "the decoded video");
}

Result<std::vector<float>> VideoDecoder::decode(std::span<const float> latents)
{
    SR_CHECK(decode_bytes(latents));
    const Ends& e = *ends_;
    const size_t channels = e.images.cols(), line = e.picture.padded_width * channels;
    SR_TRY(const auto lines, read_frames(device_, e.images, e.frames, e.picture.height * e.picture.padded_width));
    std::vector<float> images;
    for (uint32_t y = 0; y < e.frames * e.picture.height; ++y) {
        const auto first = lines.begin() + std::ptrdiff_t(y * line);
        images.insert(images.end(), first, first + std::ptrdiff_t(e.picture.width * channels));
    }
    return images;
}

Slot VideoDecoder::bytes(uint32_t frame) const
{
    SR_ASSERT(ends_->bytes.valid(), "bytes of pictures of {} channels", ends_->config.out_channels);
    return words_of_frame(ends_->bytes, ends_->frames, frame, ends_->words());
}

uint32_t VideoDecoder::frames() const
{
    return ends_->frames;
}

} // namespace semrover
