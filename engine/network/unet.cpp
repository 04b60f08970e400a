// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/unet.h"

#include "engine/network/network_blocks.h"

#include <cmath>
#include <map>
#include <utility>

namespace semrover {

namespace {

// columns of a transformer in the frame table start at a multiple of this: 256 bytes, the most that devices want
// bindings to be aligned to
constexpr uint32_t kFrameColumns = 64;

// a resnet block with what follows it on its level
struct UnetLayer {
    ResnetBlock resnet;
    uint32_t shift_col = 0; // of its time embedding, in the table
    std::optional<FrameResnet> frame_resnet;
    uint32_t frame_shift_col = 0;
    std::optional<Transformer2d> attention;
};

struct UnetLevel {
    std::vector<UnetLayer> layers;
    std::optional<Layer> resample; // to the next level
};

} // namespace

struct Unet::Impl {
    UnetConfig config;
    NetworkWeights weights;
    Layer conv_in, time_in, time_out, added_in, added_out, time_shifts, context, norm_out, conv_out;
    DeviceTensor class_embedding;
    std::vector<UnetLevel> down, up;
    std::vector<UnetLayer> mid;
    uint32_t time_width = 0, context_width = 0, frame_width = 0;
    TensorPool constants;
    DeviceTensor frequencies, added_frequencies;
    std::map<uint32_t, DeviceTensor> frame_frequencies; // by the channels of a transformer

    Impl(const UnetConfig& c, DType precision) : config(c), weights(precision, c.q8_0)
    {
        std::vector<NetworkWeights::Part> shifts, context_parts;
        declare_ends();
        declare_down(shifts, context_parts);
        declare_mid(shifts, context_parts);
        declare_up(shifts, context_parts);
        time_shifts = weights.linear(shifts, {.cols = config.time_embed_dim()});
        if (!context_parts.empty())
            context = weights.linear(context_parts, {.cols = config.cross_attention_dim, .bias = false});
        frequencies = constants.tensor(config.block_out_channels[0] / 2, 1, DType::f32, "frequencies", 1);
        if (!config.video)
            return;
        added_frequencies = constants.tensor(config.added_embed_dim / 2, 1, DType::f32, "added frequencies", 1);
        for (const uint32_t channels : config.block_out_channels)
            if (!frame_frequencies.contains(channels))
                frame_frequencies[channels] = constants.tensor(channels / 2, 1, DType::f32, "frame frequencies", 1);
    }

    // first and last layers, and the time embedding: fp32, its input is up to 1000 radians
    void declare_ends()
    {
        const uint32_t first = config.block_out_channels[0], d = config.time_embed_dim();
        conv_in = weights.conv("conv_in", {.outputs = first, .channels = config.in_channels});
        time_in = weights.linear({{"time_embedding.linear_1", d}}, {.cols = first, .dtype = DType::f32});
        time_out = weights.linear({{"time_embedding.linear_2", d}}, {.cols = d, .dtype = DType::f32});
        if (config.video) {
            const uint32_t added = config.added_numbers * config.added_embed_dim;
            added_in = weights.linear({{"add_embedding.linear_1", d}}, {.cols = added, .dtype = DType::f32});
            added_out = weights.linear({{"add_embedding.linear_2", d}}, {.cols = d, .dtype = DType::f32});
        }
        if (config.num_class_embeds)
            class_embedding = weights.table("class_embedding", config.num_class_embeds, d);
        norm_out = weights.norm("conv_norm_out", first);
        conv_out = weights.conv("conv_out", {.outputs = config.out_channels, .channels = first});
    }

    // columns of the time table for what one resnet adds
    uint32_t declare_shift(const std::string& resnet, uint32_t channels, std::vector<NetworkWeights::Part>& shifts)
    {
        // heads = 1: each block's columns start at a multiple of kRowPadding
        shifts.push_back({resnet + ".time_emb_proj", channels, 1});
        return std::exchange(time_width, time_width + round_up(channels, kRowPadding));
    }

    UnetLayer declare_layer(const std::string& block, size_t index, size_t level, const ResnetShape& shape,
                            bool attention, std::vector<NetworkWeights::Part>& shifts,
                            std::vector<NetworkWeights::Part>& context_parts)
    {
        UnetLayer layer;
        const std::string resnet = fmt::format("{}.resnets.{}", block, index);
        const std::string spatial = config.video ? resnet + ".spatial_res_block" : resnet;
        layer.resnet = declare_resnet(weights, spatial, shape);
        layer.shift_col = declare_shift(spatial, shape.outputs, shifts);
        if (config.video) {
            layer.frame_resnet = declare_frame_resnet(weights, resnet, {shape.outputs, shape.groups, shape.eps});
            layer.frame_shift_col = declare_shift(resnet + ".temporal_res_block", shape.outputs, shifts);
        }
        if (attention)
            layer.attention = declare_attention(fmt::format("{}.attentions.{}", block, index), level, context_parts);
        return layer;
    }

    Transformer2d declare_attention(const std::string& name, size_t level,
                                    std::vector<NetworkWeights::Part>& context_parts)
    {
        const Transformer2dShape shape{config.block_out_channels[level], config.heads[level],
                                       config.transformer_layers[level], config.norm_num_groups,
                                       config.use_linear_projection,     config.video};
        Transformer2d t = declare_transformer_2d(weights, name, shape, context_parts, context_width);
        if (config.video)
            t.frame_col = std::exchange(frame_width, frame_width + round_up(shape.channels, kFrameColumns));
        return t;
    }

    ResnetShape resnet_shape(uint32_t channels, uint32_t channels2, uint32_t outputs, float eps) const
    {
        return {channels, channels2, outputs, config.norm_num_groups, eps};
    }

    void declare_down(std::vector<NetworkWeights::Part>& shifts, std::vector<NetworkWeights::Part>& context_parts)
    {
        uint32_t channels = config.block_out_channels[0];
        for (size_t level = 0; level < config.levels(); ++level) {
            const std::string block = fmt::format("down_blocks.{}", level);
            const uint32_t outputs = config.block_out_channels[level];
            UnetLevel l;
            for (size_t i = 0; i < config.layers_per_block[level]; ++i) {
                l.layers.push_back(declare_layer(block, i, level,
                                                 resnet_shape(channels, 0, outputs, config.down_eps(level)),
                                                 config.down_attention[level], shifts, context_parts));
                channels = outputs;
            }
            if (level + 1 < config.levels())
                l.resample = weights.conv(block + ".downsamplers.0.conv", {.outputs = outputs, .channels = outputs});
            down.push_back(std::move(l));
        }
    }

    void declare_mid(std::vector<NetworkWeights::Part>& shifts, std::vector<NetworkWeights::Part>& context_parts)
    {
        const size_t last = config.levels() - 1;
        const ResnetShape shape =
            resnet_shape(config.block_out_channels[last], 0, config.block_out_channels[last], config.norm_eps);
        mid.push_back(declare_layer("mid_block", 0, last, shape, config.mid_attention, shifts, context_parts));
        if (config.mid_attention)
            mid.push_back(declare_layer("mid_block", 1, last, shape, false, shifts, context_parts));
    }

    // channels of the skip connections, in the order in which the down blocks make them
    std::vector<uint32_t> skip_channels() const
    {
        std::vector<uint32_t> channels{config.block_out_channels[0]};
        for (size_t level = 0; level < config.levels(); ++level)
            channels.insert(channels.end(), config.layers_per_block[level] + (level + 1 < config.levels()),
                            config.block_out_channels[level]);
        return channels;
    }

    void declare_up(std::vector<NetworkWeights::Part>& shifts, std::vector<NetworkWeights::Part>& context_parts)
    {
        std::vector<uint32_t> skips = skip_channels();
        uint32_t channels = config.block_out_channels.back();
        for (size_t i = 0; i < config.levels(); ++i) {
            const size_t level = config.levels() - 1 - i;
            const std::string block = fmt::format("up_blocks.{}", i);
            const uint32_t outputs = config.block_out_channels[level];
            UnetLevel l;
            for (size_t k = 0; k <= config.layers_per_block[level]; ++k) {
                l.layers.push_back(declare_layer(block, k, level,
                                                 resnet_shape(channels, skips.back(), outputs, config.up_eps()),
                                                 config.up_attention[i], shifts, context_parts));
                skips.pop_back();
                channels = outputs;
            }
            if (level > 0)
                l.resample = weights.conv(block + ".upsamplers.0.conv", {.outputs = outputs, .channels = outputs});
            up.push_back(std::move(l));
        }
    }

    Status upload_waves(Device& device, const DeviceTensor& slot, double freq_shift) const
    {
        std::vector<float> w(slot.rows());
        for (size_t i = 0; i < w.size(); ++i)
            w[i] = float(std::exp(-std::log(10000.0) * double(i) / (double(w.size()) - freq_shift)));
        return slot.write(device, w);
    }
    Status upload_frequencies(Device& device)
    {
        SR_CHECK(constants.allocate(device, "frequencies"));
        SR_CHECK(upload_waves(device, frequencies, config.freq_shift));
        if (added_frequencies.valid())
            SR_CHECK(upload_waves(device, added_frequencies, 0));
        for (const auto& [channels, slot] : frame_frequencies)
            SR_CHECK(upload_waves(device, slot, 0));
        return {};
    }

    // [rows, d] fp32
    Tensor embed(Graph& g, const Layer& in, const Layer& out, Tensor waves, DType dtype) const
    {
        const auto linear = [&](const Layer& layer, Tensor x, DType type) {
            return gemm(g, x, layer.weight.in(g), layer.bias.in(g), {.dtype = type});
        };
        return linear(out, silu(g, linear(in, waves, DType::f32)), dtype);
    }

    // every transformer, in the order of its frame_col
    std::vector<const Transformer2d*> transformers() const
    {
        std::vector<const Transformer2d*> all;
        const auto collect = [&](const std::vector<UnetLayer>& layers) {
            for (const UnetLayer& l : layers)
                if (l.attention)
                    all.push_back(&*l.attention);
        };
        for (const UnetLevel& level : down)
            collect(level.layers);
        collect(mid);
        for (const UnetLevel& level : up)
            collect(level.layers);
        return all;
    }

    struct Inputs {
        Tensor table, table_row;
        TextContext context;
        Videos videos = {};
    };
    FeatureMap layer(Graph& g, const UnetLayer& l, NormInput x, NormInput skip, const Inputs& in) const
    {
        const ChannelShift shift{in.table, in.table_row, l.shift_col};
        FeatureMap y = resnet(g, weights, l.resnet, x, skip, shift);
        if (!l.frame_resnet)
            return l.attention ? transformer_2d(g, weights, *l.attention, with_moments(g, y), in.context) : y;
        const FrameEmbedding& frames = in.videos.frames;
        const ChannelShift frame_shift{in.table, in.videos.table_row, l.frame_shift_col};
        y = frame_resnet(g, weights, *l.frame_resnet, with_moments(g, y), frames.frames, frame_shift);
        return l.attention ? video_transformer(g, weights, *l.attention, with_moments(g, y), in.context, frames) : y;
    }
    NormInput run_down(Graph& g, NormInput x, std::vector<NormInput>& skips, const Inputs& in) const
    {
        for (const UnetLevel& level : down) {
            for (const UnetLayer& l : level.layers)
                skips.push_back(x = with_moments(g, layer(g, l, x, {}, in)));
            if (level.resample)
                skips.push_back(x = with_moments(g, convolve(g, weights, *level.resample, x.x, {.stride = 2})));
        }
        return x;
    }
    NormInput run_up(Graph& g, NormInput x, std::vector<NormInput>& skips, const Inputs& in) const
    {
        for (const UnetLevel& level : up) {
            for (size_t i = 0; i < level.layers.size(); ++i) {
                const FeatureMap y = layer(g, level.layers[i], x, skips.back(), in);
                skips.pop_back();
                x = i + 1 == level.layers.size() && level.resample ? NormInput{y, {}} : with_moments(g, y);
            }
            if (!level.resample)
                continue;
            ConvOptions options; // to the size of the skip connection, which may be odd
            options.upsampled_height = skips.back().x.height;
            options.upsampled_width = skips.back().x.width;
            x = with_moments(g, convolve(g, weights, *level.resample, x.x, options));
        }
        return x;
    }
    FeatureMap run(Graph& g, FeatureMap x, const Inputs& in) const
    {
        NormInput h = with_moments(g, convolve(g, weights, conv_in, x));
        std::vector<NormInput> skips{h};
        h = run_down(g, h, skips, in);
        for (const UnetLayer& l : mid)
            h = with_moments(g, layer(g, l, h, {}, in));
        h = run_up(g, h, skips, in);
        GroupNormOptions norm;
        norm.groups = config.norm_num_groups;
        norm.eps = config.norm_eps;
        norm.silu = true;
        norm.dtype = weights.precision();
        const FeatureMap last = normalize(g, norm_out, norm, h);
        return conv2d(g, last, {}, conv_out.weight.in(g), conv_out.bias.in(g), {.dtype = DType::f32});
    }
};

Unet::Unet(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Unet::~Unet() = default;

std::unique_ptr<Unet> Unet::plan(const UnetConfig& config, DType precision)
{
    return std::unique_ptr<Unet>(new Unet(std::make_unique<Impl>(config, precision)));
}

Result<std::unique_ptr<Unet>> Unet::load(Device& device, const UnetConfig& config, const Checkpoint& weights,
                                         DType precision, const LoadProgress& progress)
{
    std::unique_ptr<Unet> unet = plan(config, precision);
    SR_CHECK(unet->impl_->weights.load(device, weights, unet_schema(config), progress));
    SR_CHECK(unet->impl_->upload_frequencies(device));
    return unet;
}

const UnetConfig& Unet::config() const
{
    return impl_->config;
}
DType Unet::precision() const
{
    return impl_->weights.precision();
}
uint64_t Unet::parameters() const
{
    return impl_->weights.parameters();
}
uint64_t Unet::device_bytes(const DeviceLimits& limits) const
{
    return impl_->weights.device_bytes(limits) + impl_->constants.planned_bytes(limits);
}
uint32_t Unet::time_width() const
{
    return impl_->time_width;
}
uint32_t Unet::context_width() const
{
    return impl_->context_width;
}

uint32_t Unet::frame_width() const
{
    return impl_->frame_width;
}

Tensor Unet::time_table(Graph& g, Tensor timesteps, Tensor class_labels, Tensor added) const
{
    const Impl& n = *impl_;
    const Tensor waves = sinusoid(g, timesteps, n.frequencies.in(g), n.config.flip_sin_to_cos, DType::f32);
    Tensor embedded = n.embed(g, n.time_in, n.time_out, waves, precision());
    if (n.config.video) {
        SR_ASSERT(added.valid() && added.cols == n.config.added_numbers, "this network wants {} numbers",
                  n.config.added_numbers);
        const Tensor numbers = sinusoid(g, added, n.added_frequencies.in(g), true, DType::f32);
        embedded = add(g, n.embed(g, n.added_in, n.added_out, numbers, precision()), embedded);
    }
    if (n.config.num_class_embeds) {
        SR_ASSERT(class_labels.valid(), "this network wants class labels");
        embedded = embedding(g, class_labels, n.class_embedding.in(g), embedded, precision());
    }
    const Tensor active = silu(g, embedded); // every block's projection begins with it
    return gemm(g, active, n.time_shifts.weight.in(g), n.time_shifts.bias.in(g), {.dtype = DType::f32});
}

Tensor Unet::frame_table(Graph& g, Tensor numbers) const
{
    const Impl& n = *impl_;
    SR_ASSERT(n.frame_width, "this network has no frames to tell apart");
    const Tensor table = g.matrix(numbers.rows, n.frame_width, DType::f32, "frames");
    for (const Transformer2d* t : n.transformers())
        embed_frames(g, *t, numbers, n.frame_frequencies.at(t->channels).in(g), table);
    return table;
}

Tensor Unet::context_table(Graph& g, Tensor context) const
{
    SR_ASSERT(impl_->context_width, "this network takes no text");
    return gemm(g, context, impl_->context.weight.in(g), {}, {.dtype = precision()});
}

FeatureMap Unet::forward(Graph& g, FeatureMap x, Tensor table, Tensor table_row, const Context& context) const
{
    SR_ASSERT(!impl_->config.video, "this network wants videos");
    return impl_->run(g, x, {table, table_row, context});
}

FeatureMap Unet::forward(Graph& g, FeatureMap x, Tensor table, Tensor table_row, const Context& context,
                         const Videos& videos) const
{
    SR_ASSERT(impl_->config.video, "this network takes no videos");
    return impl_->run(g, x, {table, table_row, context, videos});
}

} // namespace semrover
