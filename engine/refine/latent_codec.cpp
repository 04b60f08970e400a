// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/latent_codec.h"

#include "kernels/picture.h"

#include <algorithm>
#include <cmath>

namespace semrover {

// memory of what goes in and what comes out, and the graphs over it
struct LatentCodec::Ends {
    CodecDirection direction;
    const VaeConfig& config;
    LatentSize size;
    PictureShape picture, block_grid; // of pixels, and of the latent
    State state;
    CodecSlots slots;

    Ends(const Vae& vae, const LatentSize& latent_size, CodecDirection which)
        : direction(which), config(vae.config()),
          size(latent_size), picture{size.image_width, size.image_height, size.width() * size.downscale,
                                     size.height() * size.downscale},
          block_grid{size.width(), size.height(), size.width(), size.height()}
    {
        const auto rows = [](uint32_t pixels) { return round_up(pixels, kImageRowPadding); };
        const auto words = [&](uint32_t count, const char* name) { return state.slot(count, 1, DType::u32, name, 1); };
        const uint32_t channels = encodes() ? config.in_channels : config.out_channels;
        slots.image = state.slot(rows(picture.padded_width * picture.padded_height), channels, DType::f32, "picture");
        slots.latent = state.slot(rows(size.pixels()), config.latent_channels, DType::f32, "latent");
        slots.bad = words(1, "first number that is none");
        if (channels != 3)
            return;
        if (encodes()) {
            slots.seen = words(picture.width * picture.height, "seen");
            slots.shares = state.slot(rows(size.pixels()), 1, DType::f32, "shares", 1);
        } else {
            slots.bytes = words(picture_words(picture.width, picture.height), "bytes");
        }
    }
    bool encodes() const { return direction != CodecDirection::decode; }
    LatentScale scale() const
    {
        if (direction == CodecDirection::encode_unscaled)
            return {};
        return {config.scaling_factor, config.shift_factor, !encodes()};
    }

    Graph graph(const Vae& vae) const { return encodes() ? encode_graph(vae) : decode_graph(vae); }
    Graph encode_graph(const Vae& vae) const
    {
        Graph g;
        const FeatureMap moments = vae.encode(g, {slots.image.in(g), 1, picture.padded_height, picture.padded_width});
        expect(moments, size.width(), size.height(), 2 * config.latent_channels);
        const Tensor latent = scale_latent(g, moments.data, size.pixels(), config.latent_channels, scale());
        g.keep(latent, slots.latent);
        g.keep(first_non_finite(g, latent, block_grid), slots.bad);
        return g;
    }
    Graph decode_graph(const Vae& vae) const
    {
        Graph g;
        const Tensor z = scale_latent(g, slots.latent.in(g), size.pixels(), config.latent_channels, scale());
        const FeatureMap y = vae.decode(g, {z, 1, size.height(), size.width()});
        expect(y, picture.padded_width, picture.padded_height, config.out_channels);
        g.keep(y.data, slots.image);
        if (slots.bytes.valid())
            g.keep(picture_bytes(g, y.data, picture), slots.bytes);
        g.keep(first_non_finite(g, y.data, picture), slots.bad);
        return g;
    }
    // a picture and its visibility, for the network and the denoiser
    Graph intake_graph() const
    {
        Graph g;
        const Tensor seen = slots.seen.in(g);
        g.keep(picture_input(g, seen, picture).data, slots.image);
        g.keep(block_shares(g, seen, picture, size.downscale), slots.shares);
        return g;
    }
    static void expect(const FeatureMap& y, uint32_t width, uint32_t height, uint32_t channels)
    {
        SR_ASSERT(y.height == height && y.width == width && y.channels() == channels,
                  "the VAE gives {} x {} x {}, expected {} x {} x {}", y.height, y.width, y.channels(), height, width,
                  channels);
    }
};

LatentCodec::LatentCodec(Device& device, const Vae& vae, const LatentSize& size)
    : device_(device), vae_(vae), size_(size)
{
}
LatentCodec::~LatentCodec() = default;

Result<std::unique_ptr<LatentCodec>> LatentCodec::create(Device& device, const Vae& vae, const LatentSize& size,
                                                         CodecDirection direction)
{
    std::unique_ptr<LatentCodec> c(new LatentCodec(device, vae, size));
    c->ends_ = std::make_unique<Ends>(vae, size, direction);
    SR_CHECK(c->ends_->state.allocate(device, "pictures and latents"));
    SR_TRY(c->program_, Program::create(device, c->ends_->graph(vae)));
    if (c->slots().seen.valid()) {
        SR_TRY(c->intake_, Program::create(device, c->ends_->intake_graph()));
    }
    return c;
}

Result<uint64_t> LatentCodec::planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                            CodecDirection direction)
{
    const Ends ends(vae, size, direction);
    SR_TRY(const Plan plan, make_plan(ends.graph(vae).desc(), limits));
    uint64_t bytes = ends.state.planned_bytes(limits) + plan.arena_bytes();
    if (ends.slots.seen.valid()) {
        SR_TRY(const Plan intake, make_plan(ends.intake_graph().desc(), limits));
        bytes += intake.arena_bytes();
    }
    return bytes;
}

const CodecSlots& LatentCodec::slots() const
{
    return ends_->slots;
}

Status LatentCodec::encode_seen()
{
    SR_ASSERT(intake_, "a codec that encodes no pictures of three channels");
    SR_CHECK(intake_->submit().map([](uint64_t) {}));
    return program_->submit().map([](uint64_t) {});
}

Status LatentCodec::decode_latent()
{
    SR_ASSERT(!ends_->encodes(), "a codec that encodes is to decode");
    return program_->submit().map([](uint64_t) {});
}

Status LatentCodec::check() const
{
    const CodecSlots& s = slots();
    SR_TRY(const std::vector<uint32_t> bad, s.bad.read<uint32_t>(device_));
    if (bad.front() == ~0u)
        return {};
    const bool encodes = ends_->encodes();
    const Slot& y = encodes ? s.latent : s.image;
    const uint32_t pixel = bad.front() / y.cols(), width = ends_->picture.width;
    const uint32_t row = encodes ? pixel : pixel / width * ends_->picture.padded_width + pixel % width;
    SR_TRY(const std::vector<float> values, y.row_range(row, 1).read_rows(device_, 1));
    return not_finite(values[bad.front() % y.cols()], bad.front(),
                      encodes ? "the encoded buffer" : "the decoded frame");
}

Result<std::vector<float>> LatentCodec::encode(std::span<const float> image)
{
    const PictureShape& p = ends_->picture;
    const uint32_t channels = slots().image.cols();
    SR_ASSERT(ends_->encodes() && image.size() == size_t(p.width) * p.height * channels, "{} numbers to encode",
              image.size());
    std::vector<float> continued;
    continued.reserve(size_t(p.padded_width) * p.padded_height * channels);
    for (uint32_t y = 0; y < p.padded_height; ++y)
        for (uint32_t x = 0; x < p.padded_width; ++x) {
            const size_t from = size_t(std::min(y, p.height - 1)) * p.width + std::min(x, p.width - 1);
            continued.insert(continued.end(), &image[from * channels], &image[from * channels] + channels);
        }
    SR_CHECK(slots().image.write_rows(device_, continued));
    SR_CHECK(program_->run());
    SR_CHECK(check());
    return slots().latent.read_rows(device_, size_.pixels());
}

Result<std::vector<float>> LatentCodec::decode(std::span<const float> latent)
{
    const PictureShape& p = ends_->picture;
    const uint32_t channels = slots().image.cols();
    SR_ASSERT(!ends_->encodes() && latent.size() == size_t(size_.pixels()) * slots().latent.cols(),
              "{} numbers to decode", latent.size());
    SR_CHECK(slots().latent.write_rows(device_, latent));
    SR_CHECK(program_->run());
    SR_CHECK(check());
    SR_TRY(const std::vector<float> pixels, slots().image.read_rows(device_, p.padded_width * p.padded_height));
    std::vector<float> image;
    image.reserve(size_t(p.width) * p.height * channels);
    for (uint32_t y = 0; y < p.height; ++y) {
        const float* row = &pixels[size_t(y) * p.padded_width * channels];
        image.insert(image.end(), row, row + size_t(p.width) * channels);
    }
    return image;
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

std::vector<float> floats_of_pixels(std::span<const uint8_t> pixels)
{
    std::vector<float> values(pixels.size());
    std::ranges::transform(pixels, values.begin(), [](uint8_t v) { return float(v) / 127.5f - 1; });
    return values;
}

std::vector<uint8_t> pixels_of_floats(std::span<const float> values)
{
    std::vector<uint8_t> pixels(values.size());
    std::ranges::transform(values, pixels.begin(),
                           [](float v) { return uint8_t(std::lround(std::clamp((v + 1) * 127.5f, 0.f, 255.f))); });
    return pixels;
}

tl::unexpected<Error> not_finite(float value, size_t element, std::string_view what)
{
    return fail(ErrorCode::internal, "{} holds {} at element {}: overflow; try --precision fp32", what, value, element);
}

Status check_finite(std::span<const float> values, std::string_view what)
{
    const auto bad = std::ranges::find_if(values, [](float v) { return !std::isfinite(v); });
    if (bad != values.end())
        return not_finite(*bad, size_t(bad - values.begin()), what);
    return {};
}

} // namespace semrover
