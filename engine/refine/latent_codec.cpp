// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/latent_codec.h"

#include <algorithm>
#include <cmath>

namespace semrover {

struct LatentCodec::Ends {
    struct End {
        uint32_t width = 0, height = 0, channels = 0, slice = 0;

        uint32_t ld() const { return round_up(channels, kRowPadding); }
        uint32_t rows() const { return round_up(width * height, kImageRowPadding); }
        uint64_t bytes() const { return uint64_t(rows()) * ld() * 4; }
    };
    CodecDirection direction;
    End in, out;
    Arena arena;

    Ends(const Vae& vae, const LatentSize& size, CodecDirection which) : direction(which)
    {
        const VaeConfig& c = vae.config();
        const uint32_t w = size.width(), h = size.height();
        const End image{w * size.downscale, h * size.downscale, 0}, latent{w, h, 0};
        in = which == CodecDirection::encode ? image : latent;
        out = which == CodecDirection::encode ? latent : image;
        in.channels = which == CodecDirection::encode ? c.in_channels : c.latent_channels;
        out.channels = which == CodecDirection::encode ? 2 * c.latent_channels : c.out_channels;
        in.slice = arena.add(in.bytes());
        out.slice = arena.add(out.bytes());
    }
    Graph graph(const Vae& vae) const
    {
        Graph g;
        const Tensor x = g.external(arena.slice(in.slice), in.rows(), in.channels, DType::f32, "codec input");
        const FeatureMap from{x, 1, in.height, in.width};
        const FeatureMap y = direction == CodecDirection::encode ? vae.encode(g, from) : vae.decode(g, from);
        SR_ASSERT(y.height == out.height && y.width == out.width && y.channels() == out.channels &&
                      y.data.ld == out.ld(),
                  "the VAE gives {} x {} x {}, expected {} x {} x {}", y.height, y.width, y.channels(), out.height,
                  out.width, out.channels);
        const Tensor to = g.external(arena.slice(out.slice), out.rows(), out.channels, DType::f32, "codec output");
        g.replace(y.data.resource, to.resource);
        return g;
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
    SR_CHECK(c->ends_->arena.allocate(device, "pictures and latents"));
    SR_TRY(c->program_, Program::create(device, c->ends_->graph(vae)));
    return c;
}

Result<uint64_t> LatentCodec::planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                            CodecDirection direction)
{
    const Ends ends(vae, size, direction);
    SR_TRY(const Plan plan, make_plan(ends.graph(vae).desc(), limits));
    return ends.arena.planned_bytes(limits) + plan.arena_bytes();
}

// rows as on the device, in and out
Result<std::vector<float>> LatentCodec::run(std::span<const float> padded)
{
    SR_CHECK(device_.write(ends_->arena.slice(ends_->in.slice), std::as_bytes(padded)));
    SR_CHECK(program_->run());
    std::vector<float> out(ends_->out.bytes() / 4);
    SR_CHECK(device_.read(ends_->arena.slice(ends_->out.slice), std::as_writable_bytes(std::span(out))));
    return out;
}

Result<std::vector<float>> LatentCodec::encode(std::span<const float> image)
{
    const uint32_t channels = ends_->in.channels, ld = ends_->in.ld();
    SR_ASSERT(ends_->direction == CodecDirection::encode &&
                  image.size() == size_t(size_.image_width) * size_.image_height * channels,
              "{} numbers to encode", image.size());
    std::vector<float> padded(ends_->in.bytes() / 4, 0.f);
    for (uint32_t y = 0; y < ends_->in.height; ++y)
        for (uint32_t x = 0; x < ends_->in.width; ++x) {
            const size_t from =
                size_t(std::min(y, size_.image_height - 1)) * size_.image_width + std::min(x, size_.image_width - 1);
            std::copy_n(&image[from * channels], channels, &padded[(size_t(y) * ends_->in.width + x) * ld]);
        }
    SR_TRY(const std::vector<float> moments, run(padded));
    const VaeConfig& c = vae_.config();
    std::vector<float> latent(size_t(size_.pixels()) * c.latent_channels);
    for (size_t i = 0; i < latent.size(); ++i) {
        const float mean = moments[i / c.latent_channels * ends_->out.ld() + i % c.latent_channels];
        latent[i] = (mean - c.shift_factor) * c.scaling_factor;
    }
    SR_CHECK(check_finite(latent, "the encoded buffer"));
    return latent;
}

Result<std::vector<float>> LatentCodec::decode(std::span<const float> latent)
{
    const VaeConfig& c = vae_.config();
    SR_ASSERT(ends_->direction == CodecDirection::decode && latent.size() == size_t(size_.pixels()) * c.latent_channels,
              "{} numbers to decode", latent.size());
    std::vector<float> padded(ends_->in.bytes() / 4, 0.f);
    for (size_t i = 0; i < latent.size(); ++i)
        padded[i / c.latent_channels * ends_->in.ld() + i % c.latent_channels] =
            latent[i] / c.scaling_factor + c.shift_factor;
    SR_TRY(const std::vector<float> rows, run(padded));
    std::vector<float> image;
    image.reserve(size_t(size_.image_width) * size_.image_height * c.out_channels);
    for (uint32_t y = 0; y < size_.image_height; ++y)
        for (uint32_t x = 0; x < size_.image_width; ++x) {
            const float* pixel = &rows[(size_t(y) * ends_->out.width + x) * ends_->out.ld()];
            image.insert(image.end(), pixel, pixel + c.out_channels);
        }
    SR_CHECK(check_finite(image, "the decoded frame"));
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

Status check_finite(std::span<const float> values, std::string_view what)
{
    for (size_t i = 0; i < values.size(); ++i)
        if (!std::isfinite(values[i]))
            return fail(ErrorCode::internal, "{} holds {} at element {}: overflow; try --precision fp32", what,
                        values[i], i);
    return {};
}

} // namespace semrover
