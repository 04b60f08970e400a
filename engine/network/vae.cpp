// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/vae.h"

#include "engine/network/network_blocks.h"

#include <cmath>

namespace semrover {

namespace {

constexpr float kVaeNormEps = 1e-6f;
constexpr float kFrameNormEps = 1e-5f; // of the resnets over frames
// what the residual stream is stored multiplied by where it may exceed fp16 (force_upcast): up to 2e6 fits
constexpr float kHalfStream = 1.f / 32;

struct VaeLayer {
    ResnetBlock resnet;
    std::optional<FrameResnet> frame_resnet; // of a video's decoder
};

// resnet, attention over all pixels with one head, resnet
struct MidBlock {
    VaeLayer first;
    std::optional<VaeLayer> second; // a video's decoder of one layer per block has one resnet, and no attention
    bool attention = false;
    Layer norm, qkv, out;
};

struct VaeLevel {
    std::vector<VaeLayer> layers;
    std::optional<Layer> resample;
};

// encoder or decoder; both ends read and write fp32
struct VaeHalf {
    NetworkWeights weights;
    float stream; // what the residual stream is stored multiplied by
    Layer conv_in, norm_out, conv_out, frames_out;
    MidBlock mid;
    std::vector<VaeLevel> levels; // in the order in which they run

    VaeHalf(const VaeConfig& config, DType precision)
        : weights(precision), stream(precision == DType::f16 && config.force_upcast ? kHalfStream : 1.f)
    {
    }
};

// A video's denoiser gets the latents of its buffers unscaled and makes much of their errors: where the config asks for
// force_upcast, they are encoded in fp32, as diffusers' pipeline for videos does
DType encoder_precision(const VaeConfig& config, DType precision)
{
    return config.video && config.force_upcast ? DType::f32 : precision;
}

} // namespace

struct Vae::Impl {
    VaeConfig config;
    VaeHalf encoder, decoder;
    Layer quant_conv, post_quant_conv;

    Impl(const VaeConfig& c, DType precision)
        : config(c), encoder(c, encoder_precision(c, precision)), decoder(c, precision)
    {
        const uint32_t latent = config.latent_channels;
        declare_encoder();
        if (config.use_quant_conv)
            quant_conv = encoder.weights.conv(
                "quant_conv", {.outputs = 2 * latent, .channels = 2 * latent, .kernel = 1, .dtype = DType::f32});
        if (config.use_post_quant_conv)
            post_quant_conv = decoder.weights.conv(
                "post_quant_conv", {.outputs = latent, .channels = latent, .kernel = 1, .dtype = DType::f32});
        declare_decoder();
    }

    ResnetShape resnet_shape(const VaeHalf& half, uint32_t channels, uint32_t outputs) const
    {
        return {channels, 0, outputs, config.norm_num_groups, kVaeNormEps, half.stream};
    }

    VaeLayer declare_layer(VaeHalf& half, const std::string& name, uint32_t channels, uint32_t outputs, bool video)
    {
        const ResnetShape shape = resnet_shape(half, channels, outputs);
        if (!video)
            return {declare_resnet(half.weights, name, shape), {}};
        const FrameResnetShape frames{outputs, config.norm_num_groups, kFrameNormEps, half.stream, true};
        return {declare_resnet(half.weights, name + ".spatial_res_block", shape),
                declare_frame_resnet(half.weights, name, frames)};
    }

    MidBlock declare_mid(VaeHalf& half, const std::string& name, bool video)
    {
        const uint32_t c = config.block_out_channels.back();
        MidBlock m;
        m.first = declare_layer(half, name + ".resnets.0", c, c, video);
        if (video && config.layers_per_block == 1)
            return m;
        m.attention = config.mid_block_add_attention;
        if (m.attention) {
            const std::string a = name + ".attentions.0";
            m.norm = half.weights.norm(a + ".group_norm", c);
            m.qkv = half.weights.linear({{a + ".to_q", c, 1}, {a + ".to_k", c, 1}, {a + ".to_v", c, 1}}, {.cols = c});
            m.out = half.weights.linear({{a + ".to_out.0", c}}, {.cols = c, .col_heads = 1, .gain = half.stream});
        }
        m.second = declare_layer(half, name + ".resnets.1", c, c, video);
        return m;
    }

    Layer declare_resample(VaeHalf& half, const std::string& name, uint32_t channels)
    {
        return half.weights.conv(name, {.outputs = channels, .channels = channels, .bias_gain = half.stream});
    }

    void declare_encoder()
    {
        uint32_t channels = config.block_out_channels[0];
        encoder.conv_in = encoder.weights.conv("encoder.conv_in", {.outputs = channels,
                                                                   .channels = config.in_channels,
                                                                   .gain = encoder.stream,
                                                                   .bias_gain = encoder.stream,
                                                                   .dtype = DType::f32});
        for (size_t i = 0; i < config.block_out_channels.size(); ++i) {
            const std::string block = fmt::format("encoder.down_blocks.{}", i);
            const uint32_t outputs = config.block_out_channels[i];
            VaeLevel level;
            for (uint32_t k = 0; k < config.layers_per_block; ++k, channels = outputs)
                level.layers.push_back(
                    declare_layer(encoder, fmt::format("{}.resnets.{}", block, k), channels, outputs, false));
            if (i + 1 < config.block_out_channels.size())
                level.resample = declare_resample(encoder, block + ".downsamplers.0.conv", outputs);
            encoder.levels.push_back(std::move(level));
        }
        encoder.mid = declare_mid(encoder, "encoder.mid_block", false);
        encoder.norm_out = encoder.weights.norm("encoder.conv_norm_out", channels);
        encoder.conv_out =
            encoder.weights.conv("encoder.conv_out", {.outputs = 2 * config.latent_channels, .channels = channels});
    }

    void declare_decoder()
    {
        const size_t levels = config.block_out_channels.size();
        uint32_t channels = config.block_out_channels.back();
        decoder.conv_in = decoder.weights.conv("decoder.conv_in", {.outputs = channels,
                                                                   .channels = config.latent_channels,
                                                                   .gain = decoder.stream,
                                                                   .bias_gain = decoder.stream,
                                                                   .dtype = DType::f32});
        decoder.mid = declare_mid(decoder, "decoder.mid_block", config.video);
        for (size_t i = 0; i < levels; ++i) {
            const std::string block = fmt::format("decoder.up_blocks.{}", i);
            const uint32_t outputs = config.block_out_channels[levels - 1 - i];
            VaeLevel level;
            for (uint32_t k = 0; k <= config.layers_per_block; ++k, channels = outputs)
                level.layers.push_back(
                    declare_layer(decoder, fmt::format("{}.resnets.{}", block, k), channels, outputs, config.video));
            if (i + 1 < levels)
                level.resample = declare_resample(decoder, block + ".upsamplers.0.conv", outputs);
            decoder.levels.push_back(std::move(level));
        }
        decoder.norm_out = decoder.weights.norm("decoder.conv_norm_out", channels);
        decoder.conv_out =
            decoder.weights.conv("decoder.conv_out", {.outputs = config.out_channels, .channels = channels});
        if (!config.video)
            return;
        NetworkWeights::ConvShape frames{.outputs = config.out_channels, .channels = config.out_channels};
        frames.dtype = DType::f32;
        frames.frames = true;
        decoder.frames_out = decoder.weights.conv("decoder.time_conv_out", frames);
    }

    GroupNormOptions norm_options(const VaeHalf& half, bool with_silu) const
    {
        GroupNormOptions o;
        o.groups = config.norm_num_groups;
        o.eps = kVaeNormEps * half.stream * half.stream;
        o.silu = with_silu;
        o.dtype = half.weights.precision();
        return o;
    }

    FeatureMap attention(Graph& g, const VaeHalf& half, NormInput x) const
    {
        const FeatureMap n = normalize(g, half.mid.norm, norm_options(half, false), x);
        const Layer& qkv = half.mid.qkv;
        const float scale = 1 / std::sqrt(float(config.block_out_channels.back()));
        const FeatureMap y = image_attention(g, n, qkv.weight.in(g), qkv.bias.in(g), scale);
        return x.x.with(add(g, project(g, half.weights, half.mid.out, y.data), x.x.data));
    }

    // the images of a video are its frames
    FeatureMap run_layer(Graph& g, const VaeHalf& half, const VaeLayer& l, NormInput x) const
    {
        const FeatureMap y = resnet(g, half.weights, l.resnet, x, {});
        return l.frame_resnet ? frame_resnet(g, half.weights, *l.frame_resnet, with_moments(g, y), y.batch) : y;
    }

    NormInput mid(Graph& g, const VaeHalf& half, NormInput x) const
    {
        const MidBlock& m = half.mid;
        NormInput h = with_moments(g, run_layer(g, half, m.first, x));
        if (m.attention)
            h = with_moments(g, attention(g, half, h));
        return m.second ? with_moments(g, run_layer(g, half, *m.second, h)) : h;
    }

    // what a level hands to the next one; statistics are not wanted in front of a resampling convolution
    NormInput run_level(Graph& g, const VaeHalf& half, const VaeLevel& level, NormInput x, bool upwards) const
    {
        for (size_t i = 0; i < level.layers.size(); ++i) {
            const FeatureMap y = run_layer(g, half, level.layers[i], x);
            x = i + 1 == level.layers.size() && level.resample ? NormInput{y, {}} : with_moments(g, y);
        }
        if (!level.resample)
            return x;
        ConvOptions options;
        if (upwards) {
            options.upsampled_height = 2 * x.x.height;
            options.upsampled_width = 2 * x.x.width;
        } else {
            options.stride = 2;
            options.end_padding = true;
        }
        return with_moments(g, convolve(g, half.weights, *level.resample, x.x, options));
    }

    FeatureMap finish(Graph& g, const VaeHalf& half, NormInput x) const
    {
        const FeatureMap n = normalize(g, half.norm_out, norm_options(half, true), x);
        return conv2d(g, n, {}, half.conv_out.weight.in(g), half.conv_out.bias.in(g), {.dtype = DType::f32});
    }

    // a 1x1 convolution in fp32
    FeatureMap quantize(Graph& g, const Layer& layer, FeatureMap x) const
    {
        return conv2d(g, x, {}, layer.weight.in(g), layer.bias.in(g), {.kernel = 1, .dtype = DType::f32});
    }
};

Vae::Vae(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Vae::~Vae() = default;

std::unique_ptr<Vae> Vae::plan(const VaeConfig& config, DType precision)
{
    return std::unique_ptr<Vae>(new Vae(std::make_unique<Impl>(config, precision)));
}

Result<std::unique_ptr<Vae>> Vae::load(Device& device, const VaeConfig& config, const Checkpoint& weights,
                                       DType precision, const LoadProgress& progress)
{
    std::unique_ptr<Vae> vae = plan(config, precision);
    for (VaeHalf* half : {&vae->impl_->encoder, &vae->impl_->decoder})
        SR_CHECK(half->weights.load(device, weights, vae_schema(config), progress));
    return vae;
}

const VaeConfig& Vae::config() const
{
    return impl_->config;
}
uint64_t Vae::parameters() const
{
    return impl_->encoder.weights.parameters() + impl_->decoder.weights.parameters();
}
uint64_t Vae::device_bytes(const DeviceLimits& limits) const
{
    return impl_->encoder.weights.device_bytes(limits) + impl_->decoder.weights.device_bytes(limits);
}

FeatureMap Vae::encode(Graph& g, FeatureMap image) const
{
    const Impl& n = *impl_;
    NormInput h = with_moments(g, convolve(g, n.encoder.weights, n.encoder.conv_in, image));
    for (const VaeLevel& level : n.encoder.levels)
        h = n.run_level(g, n.encoder, level, h, false);
    const FeatureMap moments = n.finish(g, n.encoder, n.mid(g, n.encoder, h));
    return n.config.use_quant_conv ? n.quantize(g, n.quant_conv, moments) : moments;
}

FeatureMap Vae::decode(Graph& g, FeatureMap latent) const
{
    const Impl& n = *impl_;
    if (n.config.use_post_quant_conv)
        latent = n.quantize(g, n.post_quant_conv, latent);
    NormInput h = with_moments(g, convolve(g, n.decoder.weights, n.decoder.conv_in, latent));
    h = n.mid(g, n.decoder, h);
    for (const VaeLevel& level : n.decoder.levels)
        h = n.run_level(g, n.decoder, level, h, true);
    const FeatureMap y = n.finish(g, n.decoder, h);
    return n.config.video ? convolve_frames(g, n.decoder.frames_out, y, y.batch, DType::f32) : y;
}

} // namespace semrover
