// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/frame_codec.h"

#include "engine/deferred/frame_slots.h"
#include "kernels/picture.h"

#include <algorithm>

namespace semrover {

namespace {

PictureShape picture_of(const LatentSize& s)
{
    return {s.image_width, s.image_height, s.width() * s.downscale, s.height() * s.downscale};
}

void expect(const FeatureMap& y, uint32_t width, uint32_t height, uint32_t channels)
{
    SR_ASSERT(y.height == height && y.width == width && y.channels() == channels,
              "the VAE gives {} x {} x {}, expected {} x {} x {}", y.height, y.width, y.channels(), height, width,
              channels);
}

} // namespace

struct FrameEncoder::Ends {
    const Vae& vae;
    LatentSize size;
    PictureShape picture;
    LatentScale scale;
    TensorPool state;
    DeviceTensor image, latent,
        bad; // [pixels of whole blocks, channels], [latent pixels, latent_channels], first_non_finite()
    DeviceTensor seen, shares; // where there are three channels: what encode_seen() takes, visible share of each block

    Ends(const Vae& v, const LatentSize& latent_size, bool unscaled)
        : vae(v), size(latent_size), picture(picture_of(size))
    {
        const VaeConfig& c = vae.config();
        if (!unscaled)
            scale = {c.scaling_factor, c.shift_factor, false};
        const auto rows = [](uint32_t pixels) { return round_up(pixels, kImageRowPadding); };
        image = state.tensor(rows(picture.padded_width * picture.padded_height), c.in_channels, DType::f32, "picture");
        latent = state.tensor(rows(size.pixels()), c.latent_channels, DType::f32, "latent");
        bad = state.tensor(1, 1, DType::u32, "first number that is none", 1);
        if (c.in_channels != 3)
            return;
        seen = state.tensor(picture.width * picture.height, 1, DType::u32, "seen", 1);
        shares = state.tensor(rows(size.pixels()), 1, DType::f32, "shares", 1);
    }
    Graph graph(const DeviceLimits& limits) const
    {
        Graph g(limits);
        const uint32_t channels = vae.config().latent_channels;
        const FeatureMap moments = vae.encode(g, {image.in(g), 1, picture.padded_height, picture.padded_width});
        expect(moments, size.width(), size.height(), 2 * channels);
        const Tensor scaled = scale_latent(g, moments.data, size.pixels(), channels, scale);
        g.keep(scaled, latent);
        g.keep(first_non_finite(g, scaled, {size.width(), size.height(), size.width(), size.height()}), bad);
        return g;
    }
    // a picture and its visibility, for the network and the denoiser
    Graph intake_graph(const DeviceLimits& limits) const
    {
        Graph g(limits);
        const Tensor words = seen.in(g);
        g.keep(picture_input(g, words, picture).data, image);
        g.keep(block_shares(g, words, picture, size.downscale), shares);
        return g;
    }
    Result<PartBytes> planned(const DeviceLimits& limits) const
    {
        PartBytes bytes{state.planned_bytes(limits), {}};
        SR_TRY(const Plan plan, make_plan(graph(limits)));
        bytes.arena.cover({plan.blocks});
        if (seen.valid()) {
            SR_TRY(const Plan intake, make_plan(intake_graph(limits)));
            bytes.arena.cover({intake.blocks});
        }
        return bytes;
    }
};

FrameEncoder::FrameEncoder(Device& device, std::unique_ptr<Ends> ends) : device_(device), ends_(std::move(ends)) {}
FrameEncoder::~FrameEncoder() = default;

Result<std::unique_ptr<FrameEncoder>> FrameEncoder::create(Device& device, const Vae& vae, const LatentSize& size,
                                                           bool unscaled, SharedArena arena)
{
    std::unique_ptr<FrameEncoder> e(new FrameEncoder(device, std::make_unique<Ends>(vae, size, unscaled)));
    SR_CHECK(e->ends_->state.allocate(device, "a picture and its latent"));
    if (!arena) {
        SR_TRY(const PartBytes planned, e->ends_->planned(device.limits()));
        SR_TRY(arena, Arena::create(device, planned.arena));
    }
    e->arena_ = std::move(arena);
    SR_TRY(e->executable_, e->arena_->executable(e->ends_->graph(device.limits())));
    if (e->seen().valid()) {
        SR_TRY(e->intake_, e->arena_->executable(e->ends_->intake_graph(device.limits())));
    }
    return e;
}

Result<PartBytes> FrameEncoder::planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size)
{
    return Ends(vae, size, false).planned(limits);
}

const DeviceTensor& FrameEncoder::seen() const
{
    return ends_->seen;
}

Result<EncodedBuffer> FrameEncoder::encode_seen()
{
    SR_ASSERT(intake_, "an encoder of pictures that have not three channels");
    SR_CHECK(intake_->submit().map([](uint64_t) {}));
    SR_CHECK(executable_->submit().map([](uint64_t) {}));
    SR_CHECK(check()); // waits
    SR_CHECK(intake_->collect_profile());
    SR_CHECK(executable_->collect_profile());
    EncodedBuffer encoded;
    SR_TRY(encoded.latent, ends_->latent.read_rows(device_, ends_->size.pixels()));
    SR_TRY(encoded.visible, ends_->shares.read_rows(device_, ends_->size.pixels()));
    return encoded;
}

Status FrameEncoder::check() const
{
    const LatentSize& s = ends_->size;
    return check_frame_words(device_, ends_->bad, ends_->latent, 1, {s.width(), s.height(), s.width(), s.height()},
                             "the encoded buffer");
}

Result<std::vector<float>> FrameEncoder::encode(std::span<const float> pixels)
{
    const PictureShape& p = ends_->picture;
    const uint32_t channels = ends_->image.cols();
    SR_ASSERT(pixels.size() == size_t(p.width) * p.height * channels, "{} numbers to encode", pixels.size());
    std::vector<float> continued;
    continued.reserve(size_t(p.padded_width) * p.padded_height * channels);
    for (uint32_t y = 0; y < p.padded_height; ++y)
        for (uint32_t x = 0; x < p.padded_width; ++x) {
            const size_t from = size_t(std::min(y, p.height - 1)) * p.width + std::min(x, p.width - 1);
            continued.insert(continued.end(), &pixels[from * channels], &pixels[from * channels] + channels);
        }
    SR_CHECK(ends_->image.write_rows(device_, continued));
    SR_CHECK(executable_->run());
    SR_CHECK(check());
    return ends_->latent.read_rows(device_, ends_->size.pixels());
}

struct FrameDecoder::Ends {
    const Vae& vae;
    LatentSize size;
    PictureShape picture;
    uint32_t frames;
    TensorPool state;
    DeviceTensor latents, images, bytes, bad; // bytes: of three channels; bad: first_non_finite() of each frame

    Ends(const Vae& v, const LatentSize& latent_size, uint32_t frame_count)
        : vae(v), size(latent_size), picture(picture_of(size)), frames(frame_count)
    {
        const VaeConfig& c = vae.config();
        const auto rows = [&](uint32_t pixels) { return frames * round_up(pixels, kImageRowPadding); };
        latents = state.tensor(rows(size.pixels()), c.latent_channels, DType::f32, "latents");
        images =
            state.tensor(rows(picture.padded_width * picture.padded_height), c.out_channels, DType::f32, "pictures");
        bad = frame_words(state, frames, 1, "first number that is none");
        if (c.out_channels == 3)
            bytes = frame_words(state, frames, words(), "bytes");
    }
    uint32_t words() const { return picture_words(picture.width, picture.height); }
    Graph graph(const DeviceLimits& limits) const
    {
        Graph g(limits);
        const VaeConfig& c = vae.config();
        const Tensor z = latents.in(g);
        const uint32_t pixels = frames == 1 ? size.pixels() : z.rows;
        const Tensor unscaled = scale_latent(g, z, pixels, c.latent_channels, {c.scaling_factor, c.shift_factor, true});
        const FeatureMap y = vae.decode(g, {unscaled, frames, size.height(), size.width()});
        expect(y, picture.padded_width, picture.padded_height, c.out_channels);
        const Tensor all = g.keep(y.data, images);
        check_frames(g, images, frames, picture, bad);
        for (uint32_t f = 0; bytes.valid() && f < frames; ++f)
            g.keep(picture_bytes(g, all.row_range(f * y.image_rows(), y.image_rows()), picture),
                   words_of_frame(bytes, frames, f, words()));
        return g;
    }
    Result<PartBytes> planned(const DeviceLimits& limits) const
    {
        SR_TRY(const Plan plan, make_plan(graph(limits)));
        return PartBytes{state.planned_bytes(limits), {plan.blocks}};
    }
};

FrameDecoder::FrameDecoder(Device& device, std::unique_ptr<Ends> ends) : device_(device), ends_(std::move(ends)) {}
FrameDecoder::~FrameDecoder() = default;

Result<std::unique_ptr<FrameDecoder>> FrameDecoder::create(Device& device, const Vae& vae, const LatentSize& size,
                                                           uint32_t frames, SharedArena arena)
{
    std::unique_ptr<FrameDecoder> d(new FrameDecoder(device, std::make_unique<Ends>(vae, size, frames)));
    SR_CHECK(d->ends_->state.allocate(device, "latents and their pictures"));
    if (!arena) {
        SR_TRY(const PartBytes planned, d->ends_->planned(device.limits()));
        SR_TRY(arena, Arena::create(device, planned.arena));
    }
    d->arena_ = std::move(arena);
    SR_TRY(d->executable_, d->arena_->executable(d->ends_->graph(device.limits())));
    return d;
}

Result<PartBytes> FrameDecoder::planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                              uint32_t frames)
{
    return Ends(vae, size, frames).planned(limits);
}

Status FrameDecoder::decode_bytes(std::span<const float> latents)
{
    const Ends& e = *ends_;
    SR_ASSERT(latents.size() == size_t(e.frames) * e.size.pixels() * e.latents.cols(), "{} numbers to decode",
              latents.size());
    SR_CHECK(write_frames(device_, e.latents, e.frames, latents));
    SR_CHECK(executable_->run());
    return check_frame_words(device_, e.bad, e.images, e.frames, e.picture,
                             e.frames == 1 ? "the decoded frame" : "the decoded video");
}

Result<std::vector<float>> FrameDecoder::decode(std::span<const float> latents)
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

DeviceTensor FrameDecoder::bytes(uint32_t frame) const
{
    SR_ASSERT(ends_->bytes.valid(), "bytes of pictures of {} channels", ends_->images.cols());
    return words_of_frame(ends_->bytes, ends_->frames, frame, ends_->words());
}

std::vector<float> block_shares(const LatentSize& size, std::span<const uint8_t> visible)
{
    SR_ASSERT(visible.size() == size_t(size.image_width) * size.image_height, "{} pixels of visibility",
              visible.size());
    std::vector<float> shares(size.pixels());
    const uint32_t n = size.downscale;
    for (uint32_t y = 0; y < size.height() * n; ++y)
        for (uint32_t x = 0; x < size.width() * n; ++x) {
            const size_t from =
                size_t(std::min(y, size.image_height - 1)) * size.image_width + std::min(x, size.image_width - 1);
            shares[size_t(y / n) * size.width() + x / n] += visible[from] ? 1.f : 0.f;
        }
    for (float& share : shares)
        share /= float(n * n);
    return shares;
}

} // namespace semrover
