// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/transformer_weights.h"

#include "engine/model/checkpoint.h"
#include "engine/model/weight_blocks.h"

#include <algorithm>

namespace semrover {

TransformerWeights::TransformerWeights(const TransformerConfig& config, DType precision)
    : config_(config), precision_(precision)
{
    const uint32_t d = config.dim(), c = config.channels(), p = config.pos_embed_dim;
    const auto linear = [&](const std::string& name, uint32_t out, uint32_t in, DType dtype, DeviceTensor& w,
                            DeviceTensor& b) {
        w = add(out, in, dtype, name);
        b = add(1, out, DType::f32, name + ".bias");
        place(name, w, b, 0, out);
    };
    linear("proj_in", d, c, precision, proj_in, proj_in_bias);
    linear("pos_embed", d, 3 * p, precision, pos_embed, pos_embed_bias);
    linear("time_embed.linear_1", d, 256, DType::f32, time_in, time_in_bias);
    linear("time_embed.linear_2", d, d, DType::f32, time_out, time_out_bias);
    linear("proj_out", c, d, precision, proj_out, proj_out_bias);
    semantic_embed = add(config.num_classes + 1, d, precision, "semantic_embed");
    place("semantic_embed", semantic_embed);
    if (const uint32_t width = config.condition_width()) {
        condition_in = add(d, width, precision, "condition_embed.linear_1");
        condition_out = add(d, d, precision, "condition_embed.linear_2");
        place("condition_embed.linear_1", condition_in);
        place("condition_embed.linear_2", condition_out);
    }
    if (config.condition_voxels) {
        condition_voxels = add(d, d, precision, "condition_embed.linear_voxels");
        place("condition_embed.linear_voxels", condition_voxels);
    }
    norm_out = add(2 * d, d, precision, "norm_out");
    norm_out_bias = add(1, 2 * d, DType::f32, "norm_out.bias");
    place_swapped("norm_out.linear", norm_out, norm_out_bias, 0, 2 * d);
    blocks.resize(config.num_layers);
    for (uint32_t i = 0; i < config.num_layers; ++i)
        add_block(i, i + 1 == config.num_layers);
}

DeviceTensor TransformerWeights::add(uint32_t rows, uint32_t cols, DType dtype, std::string_view name)
{
    weights_.push_back({state_.tensor(rows, cols, dtype, name), {}});
    return weights_.back().weight;
}

DType TransformerWeights::type_of(const std::string& weight, uint32_t cols) const
{
    return config_.q8_0 && stored_in_blocks(weight, std::array<uint64_t, 2>{1, cols}) ? DType::q8_0 : precision_;
}

std::vector<TensorSpec> TransformerWeights::schema() const
{
    std::vector<TensorSpec> specs = schema_of(weights_);
    return config_.q8_0 ? with_scales(std::move(specs)) : specs;
}

void TransformerWeights::put(const DeviceTensor& slot, WeightPart part)
{
    const auto at = std::ranges::find_if(weights_, [&](const WeightLayout& w) { return w.weight.same_as(slot); });
    at->parts.push_back(std::move(part));
}

// all of a matrix
void TransformerWeights::place(const std::string& name, const DeviceTensor& weight)
{
    put(weight, {{name + ".weight", {weight.rows(), weight.cols()}},
                 weight.cols(),
                 straight(weight.rows()),
                 straight(weight.cols())});
}

void TransformerWeights::place(const std::string& name, const DeviceTensor& weight, const DeviceTensor& bias,
                               uint32_t row, uint32_t rows, uint32_t bias_row, uint32_t bias_col)
{
    put(weight,
        {{name + ".weight", {rows, weight.cols()}}, weight.cols(), straight(rows, row), straight(weight.cols())});
    put(bias, {{name + ".bias", {rows}}, rows, straight(1, bias_row), straight(rows, bias_col)});
}

// AdaLayerNormContinuous stores scale before shift; the kernels want shift before scale
void TransformerWeights::place_swapped(const std::string& name, const DeviceTensor& weight, const DeviceTensor& bias,
                                       uint32_t row, uint32_t rows)
{
    const uint32_t half = rows / 2;
    const IndexRanges swapped{{0, row + half, half}, {half, row, half}};
    put(weight, {{name + ".weight", {rows, weight.cols()}}, weight.cols(), swapped, straight(weight.cols())});
    put(bias, {{name + ".bias", {rows}}, rows, straight(1), swapped});
}

void TransformerWeights::add_block(uint32_t index, bool last)
{
    BlockWeights& b = blocks[index];
    const uint32_t d = config_.dim(), streams = last ? 1 : 2, modulations = last ? 8 * d : 12 * d;
    const std::string block = fmt::format("transformer_blocks.{}.", index);
    const DType type = type_of(block + "attn.to_q.weight", d), wide = type_of(block + "ff.net.2.weight", 4 * d);
    b.qkv = add(6 * d, d, type, "qkv");
    b.qkv_bias = add(2, 3 * d, DType::f32, "qkv.bias");
    b.out = add(streams * d, d, type, "out");
    b.out_bias = add(streams, d, DType::f32, "out.bias");
    b.ff_in = add(streams * 4 * d, d, type, "ff_in");
    b.ff_in_bias = add(streams, 4 * d, DType::f32, "ff_in.bias");
    b.ff_out = add(streams * d, 4 * d, wide, "ff_out");
    b.ff_out_bias = add(streams, d, DType::f32, "ff_out.bias");
    b.modulation = add(modulations, d, type, "modulation");
    b.modulation_bias = add(1, modulations, DType::f32, "modulation.bias");
    for (uint32_t stream = 0; stream < 2; ++stream)
        add_stream(block, b, stream, last);
    if (!config_.qk_norm)
        return;
    b.head_norms = add(4, config_.attention_head_dim, DType::f32, "head_norms");
    const char* norms[] = {"norm_q", "norm_k", "norm_added_q", "norm_added_k"};
    for (uint32_t i = 0; i < 4; ++i)
        put(b.head_norms, {{block + "attn." + norms[i] + ".weight", {config_.attention_head_dim}},
                           config_.attention_head_dim,
                           straight(1, i),
                           straight(config_.attention_head_dim)});
}

void TransformerWeights::add_stream(const std::string& block, const BlockWeights& b, uint32_t stream, bool last)
{
    const uint32_t d = config_.dim();
    static constexpr const char* kProjections[2][3] = {{"to_q", "to_k", "to_v"},
                                                       {"add_q_proj", "add_k_proj", "add_v_proj"}};
    for (uint32_t i = 0; i < 3; ++i)
        place(block + "attn." + kProjections[stream][i], b.qkv, b.qkv_bias, (stream * 3 + i) * d, d, stream, i * d);
    if (last && stream == 1) {
        place_swapped(block + "norm1_context.linear", b.modulation, b.modulation_bias, 6 * d, 2 * d);
        return;
    }
    place(block + (stream ? "norm1_context.linear" : "norm1.linear"), b.modulation, b.modulation_bias, stream * 6 * d,
          6 * d, 0, stream * 6 * d);
    place(block + (stream ? "attn.to_add_out" : "attn.to_out.0"), b.out, b.out_bias, stream * d, d, stream);
    const std::string ff = block + (stream ? "ff_context" : "ff");
    place(ff + ".net.0.proj", b.ff_in, b.ff_in_bias, stream * 4 * d, 4 * d, stream);
    place(ff + ".net.2", b.ff_out, b.ff_out_bias, stream * d, d, stream);
}

Status TransformerWeights::load(Device& device, const SafetensorsSet& file, const LowRankAdapter& adapter,
                                const LoadProgress& progress)
{
    SR_CHECK(file.require(schema()));
    SR_CHECK(adapter.require(schema_of(weights_)));
    SR_CHECK(state_.allocate(device, "transformer weights"));
    const auto values = [&](const TensorSpec& spec, std::vector<float>& scratch) -> Result<TensorValues> {
        const TensorInfo* info = file.find(spec.name);
        const TensorValues in_file{file.bytes(*info), info->dtype, file.path(), spec.name};
        if (!adapter.has(spec.name))
            return in_file;
        SR_CHECK(check_finite(file, *info));
        if (info->dtype == DType::i8) {
            const TensorInfo& scales = *file.find(scales_of(spec).name);
            SR_CHECK(check_finite(file, scales));
            from_blocks(in_file.bytes, file.bytes(scales), uint32_t(info->shape[1]), 1, scratch);
        } else {
            scratch.resize(info->elements());
            to_float(in_file.bytes, info->dtype, scratch.data());
        }
        adapter.add(spec.name, scratch);
        return TensorValues{std::as_bytes(std::span(scratch)), DType::f32, file.path(), spec.name};
    };
    return load_weights(device, weights_, values, progress);
}

Status TransformerWeights::randomize(Device& device, uint64_t seed)
{
    SR_CHECK(state_.allocate(device, "transformer weights"));
    return load_weights(device, weights_, [&](const TensorSpec& spec, std::vector<float>& scratch) {
        random_tensor(seed, spec, scratch);
        return Result<TensorValues>({std::as_bytes(std::span(scratch)), DType::f32, {}, spec.name});
    });
}

} // namespace semrover
