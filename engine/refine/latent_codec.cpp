// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/latent_codec.h"

#include <algorithm>
#include <cmath>

namespace semrover {

// memory of what goes in and what comes out: matrices of a picture or a latent, a row a pixel
struct LatentCodec::Ends {
    CodecDirection direction;
    uint32_t in_width, in_height, out_width, out_height;
    State state;
    Slot in, out;

    Ends(const Vae& vae, const LatentSize& size, CodecDirection which) : direction(which)
    {
        const VaeConfig& c = vae.config();
        const bool encodes = which == CodecDirection::encode;
        const uint32_t n = size.downscale;
        in_width = size.width() * (encodes ? n : 1);
        in_height = size.height() * (encodes ? n : 1);
        out_width = size.width() * (encodes ? 1 : n);
        out_height = size.height() * (encodes ? 1 : n);
        const auto end = [&](uint32_t width, uint32_t height, uint32_t channels, const char* name) {
            return state.slot(round_up(width * height, kImageRowPadding), channels, DType::f32, name);
        };
        in = end(in_width, in_height, encodes ? c.in_channels : c.latent_channels, "codec input");
        out = end(out_width, out_height, encodes ? 2 * c.latent_channels : c.out_channels, "codec output");
    }
    Graph graph(const Vae& vae) const
    {
        Graph g;
        const FeatureMap from{in.in(g), 1, in_height, in_width};
        const FeatureMap y = direction == CodecDirection::encode ? vae.encode(g, from) : vae.decode(g, from);
        SR_ASSERT(y.height == out_height && y.width == out_width && y.channels() == out.cols(),
                  "the VAE gives {} x {} x {}, expected {} x {} x {}", y.height, y.width, y.channels(), out_height,
                  out_width, out.cols());
        g.keep(y.data, out);
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
    SR_CHECK(c->ends_->state.allocate(device, "pictures and latents"));
    SR_TRY(c->program_, Program::create(device, c->ends_->graph(vae)));
    return c;
}

Result<uint64_t> LatentCodec::planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                            CodecDirection direction)
{
    const Ends ends(vae, size, direction);
    SR_TRY(const Plan plan, make_plan(ends.graph(vae).desc(), limits));
    return ends.state.planned_bytes(limits) + plan.arena_bytes();
}

// pixels without padding, in and out
Result<std::vector<float>> LatentCodec::run(std::span<const float> pixels)
{
    SR_CHECK(ends_->in.write_rows(device_, pixels));
    SR_CHECK(program_->run());
    return ends_->out.read_rows(device_, ends_->out_width * ends_->out_height);
}

Result<std::vector<float>> LatentCodec::encode(std::span<const float> image)
{
    const uint32_t channels = ends_->in.cols(), width = ends_->in_width, height = ends_->in_height;
    SR_ASSERT(ends_->direction == CodecDirection::encode &&
                  image.size() == size_t(size_.image_width) * size_.image_height * channels,
              "{} numbers to encode", image.size());
    std::vector<float> continued;
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const size_t from =
                size_t(std::min(y, size_.image_height - 1)) * size_.image_width + std::min(x, size_.image_width - 1);
            continued.insert(continued.end(), &image[from * channels], &image[from * channels] + channels);
        }
    SR_TRY(const std::vector<float> moments, run(continued));
    const VaeConfig& c = vae_.config();
    std::vector<float> latent(size_t(size_.pixels()) * c.latent_channels);
    for (size_t i = 0; i < latent.size(); ++i) {
        const float mean = moments[i / c.latent_channels * ends_->out.cols() + i % c.latent_channels];
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
    std::vector<float> scaled(latent.size());
    for (size_t i = 0; i < latent.size(); ++i)
        scaled[i] = latent[i] / c.scaling_factor + c.shift_factor;
    SR_TRY(const std::vector<float> pixels, run(scaled));
    std::vector<float> image;
    image.reserve(size_t(size_.image_width) * size_.image_height * c.out_channels);
    for (uint32_t y = 0; y < size_.image_height; ++y) {
        const float* row = &pixels[size_t(y) * ends_->out_width * c.out_channels];
        image.insert(image.end(), row, row + size_t(size_.image_width) * c.out_channels);
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
