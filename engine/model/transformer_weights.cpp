// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/transformer_weights.h"

#include <cmath>
#include <cstring>
#include <map>

namespace semrover {

TransformerWeights::TransformerWeights(const TransformerConfig& config, DType precision)
    : config_(config), precision_(precision)
{
    const uint32_t d = config.dim(), c = config.channels(), p = config.pos_embed_dim;
    const auto linear = [&](const std::string& name, uint32_t out, uint32_t in, DType dtype, Slot& w, Slot& b) {
        w = state_.slot(out, in, dtype, name);
        b = state_.slot(1, out, DType::f32, name + ".bias");
        place(name, w, b, 0, out);
    };
    linear("proj_in", d, c, precision, proj_in, proj_in_bias);
    linear("pos_embed", d, 3 * p, precision, pos_embed, pos_embed_bias);
    linear("time_embed.linear_1", d, 256, DType::f32, time_in, time_in_bias);
    linear("time_embed.linear_2", d, d, DType::f32, time_out, time_out_bias);
    linear("proj_out", c, d, precision, proj_out, proj_out_bias);
    semantic_embed = state_.slot(config.num_classes + 1, d, precision, "semantic_embed");
    parts_.push_back(
        {"semantic_embed.weight", config.num_classes + 1, d, false, 0, config.num_classes + 1, semantic_embed, 0, 0});
    if (const uint32_t width = config.condition_width()) {
        condition_in = state_.slot(d, width, precision, "condition_embed.linear_1");
        condition_out = state_.slot(d, d, precision, "condition_embed.linear_2");
        parts_.push_back({"condition_embed.linear_1.weight", d, width, false, 0, d, condition_in, 0, 0});
        parts_.push_back({"condition_embed.linear_2.weight", d, d, false, 0, d, condition_out, 0, 0});
    }
    if (config.condition_voxels) {
        condition_voxels = state_.slot(d, d, precision, "condition_embed.linear_voxels");
        parts_.push_back({"condition_embed.linear_voxels.weight", d, d, false, 0, d, condition_voxels, 0, 0});
    }
    norm_out = state_.slot(2 * d, d, precision, "norm_out");
    norm_out_bias = state_.slot(1, 2 * d, DType::f32, "norm_out.bias");
    place_swapped("norm_out.linear", norm_out, norm_out_bias, 0, 2 * d);
    blocks.resize(config.num_layers);
    for (uint32_t i = 0; i < config.num_layers; ++i)
        add_block(i, i + 1 == config.num_layers);
}

void TransformerWeights::place(const std::string& name, const Slot& weight, const Slot& bias, uint32_t row,
                               uint32_t rows, uint32_t bias_row, uint32_t bias_col)
{
    parts_.push_back({name + ".weight", rows, weight.cols(), false, 0, rows, weight, row, 0});
    parts_.push_back({name + ".bias", 1, rows, true, 0, rows, bias, bias_row, bias_col});
}

// AdaLayerNormContinuous stores scale before shift; the kernels want shift before scale
void TransformerWeights::place_swapped(const std::string& name, const Slot& weight, const Slot& bias, uint32_t row,
                                       uint32_t rows)
{
    const uint32_t half = rows / 2;
    for (uint32_t part = 0; part < 2; ++part) {
        const uint32_t to = row + (1 - part) * half;
        parts_.push_back({name + ".weight", rows, weight.cols(), false, part * half, half, weight, to, 0});
        parts_.push_back({name + ".bias", 1, rows, true, part * half, half, bias, 0, to});
    }
}

void TransformerWeights::add_block(uint32_t index, bool last)
{
    BlockWeights& b = blocks[index];
    const uint32_t d = config_.dim(), streams = last ? 1 : 2, modulations = last ? 8 * d : 12 * d;
    b.qkv = state_.slot(6 * d, d, precision_, "qkv");
    b.qkv_bias = state_.slot(2, 3 * d, DType::f32, "qkv.bias");
    b.out = state_.slot(streams * d, d, precision_, "out");
    b.out_bias = state_.slot(streams, d, DType::f32, "out.bias");
    b.ff_in = state_.slot(streams * 4 * d, d, precision_, "ff_in");
    b.ff_in_bias = state_.slot(streams, 4 * d, DType::f32, "ff_in.bias");
    b.ff_out = state_.slot(streams * d, 4 * d, precision_, "ff_out");
    b.ff_out_bias = state_.slot(streams, d, DType::f32, "ff_out.bias");
    b.modulation = state_.slot(modulations, d, precision_, "modulation");
    b.modulation_bias = state_.slot(1, modulations, DType::f32, "modulation.bias");
    const std::string block = fmt::format("transformer_blocks.{}.", index);
    for (uint32_t stream = 0; stream < 2; ++stream)
        add_stream(block, b, stream, last);
    if (!config_.qk_norm)
        return;
    b.head_norms = state_.slot(4, config_.attention_head_dim, DType::f32, "head_norms");
    const char* norms[] = {"norm_q", "norm_k", "norm_added_q", "norm_added_k"};
    for (uint32_t i = 0; i < 4; ++i)
        parts_.push_back({block + "attn." + norms[i] + ".weight", 1, config_.attention_head_dim, true, 0,
                          config_.attention_head_dim, b.head_norms, i, 0});
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

uint64_t TransformerWeights::parameters() const
{
    uint64_t sum = 0;
    for (const Part& p : parts_)
        sum += uint64_t(p.count) * (p.vector ? 1 : p.cols);
    return sum;
}

// values: the part's rows, unpadded; written in rows of the target with zero padding
Status TransformerWeights::upload(Device& device, const Part& part, const float* values)
{
    const uint32_t rows = part.vector ? 1 : part.count, cols = part.vector ? part.count : part.cols;
    const uint32_t ld = part.target.ld(), bytes = uint32_t(dtype_bytes(part.target.dtype()));
    const uint32_t width = part.vector ? cols : ld; // a vector may be a piece of a row that others share
    std::vector<std::byte> packed(size_t(rows) * width * bytes);
    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t c = 0; c < cols; ++c) {
            const size_t at = (size_t(r) * width + c) * bytes;
            const float v = values[size_t(r) * cols + c];
            const uint16_t half = float_to_half(v);
            std::memcpy(&packed[at], bytes == 2 ? static_cast<const void*>(&half) : &v, bytes);
        }
    const uint64_t at = (uint64_t(part.target_row) * ld + part.target_col) * bytes;
    const BufferSlice memory = part.target.slice();
    return device.write(memory.part(at, memory.bytes - at), packed);
}

Status TransformerWeights::load(Device& device, const SafetensorsSet& file, const LowRankAdapter& adapter,
                                const LoadProgress& progress)
{
    std::map<std::string, TensorSpec> specs;
    for (const Part& p : parts_) {
        std::vector<uint64_t> shape{p.file_rows, p.cols};
        if (p.vector)
            shape = {p.cols};
        specs[p.name] = {p.name, shape};
    }
    std::vector<TensorSpec> schema;
    for (auto& [name, spec] : specs)
        schema.push_back(std::move(spec));
    SR_CHECK(file.require(schema));
    SR_CHECK(adapter.require(schema));
    SR_CHECK(state_.allocate(device, "transformer weights"));
    std::vector<float> values;
    for (const Part& p : parts_) {
        const TensorInfo* info = file.find(p.name);
        if (!p.first)
            SR_CHECK(check_finite(file, *info));
        const uint64_t row = (p.vector ? 1 : p.cols) * dtype_bytes(info->dtype);
        const auto bytes = file.bytes(*info).subspan(p.first * row, p.count * row);
        values.resize(bytes.size() / dtype_bytes(info->dtype));
        to_float(bytes, info->dtype, values.data());
        adapter.add(p.name, p.first, p.cols, values);
        SR_CHECK(upload(device, p, values.data()));
        if (progress)
            SR_CHECK(progress(values.size() * dtype_bytes(p.target.dtype())));
    }
    return {};
}

Status TransformerWeights::randomize(Device& device, uint64_t seed)
{
    SR_CHECK(state_.allocate(device, "transformer weights"));
    uint64_t state = seed * 0x9e3779b97f4a7c15ull + 1;
    std::vector<float> values;
    for (const Part& p : parts_) {
        values.resize(size_t(p.count) * (p.vector ? 1 : p.cols));
        const float scale = p.vector ? 0.02f : 1.f / std::sqrt(float(p.cols));
        for (float& v : values) {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            v = scale * 1.7320508f * (float(state >> 40) / 8388608.f - 1); // uniform, variance scale^2
        }
        SR_CHECK(upload(device, p, values.data()));
    }
    return {};
}

} // namespace semrover
