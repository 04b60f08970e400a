// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/network_weights.h"

#include "engine/model/weight_blocks.h"

namespace semrover {

namespace {

uint32_t packed_rows(const NetworkWeights::Part& p)
{
    return p.geglu ? 2 * round_up(p.rows / 2, kRowPadding) : p.heads ? padded_heads(p.rows, p.heads) : p.rows;
}

IndexRanges rows_of(const NetworkWeights::Part& p, uint32_t first)
{
    return p.geglu ? interleaved(p.rows, first) : of_heads(p.rows, p.heads, first);
}

WeightPart vector_part(const std::string& name, uint32_t size, IndexRanges cols, float gain)
{
    WeightPart part{{name, {size}}, size, straight(1), std::move(cols)};
    part.gain = gain;
    return part;
}

} // namespace

DType NetworkWeights::type_of(const TensorSpec& weight, std::optional<DType> other) const
{
    return blocks_ && stored_in_blocks(weight.name, weight.shape) ? DType::q8_0 : other.value_or(precision_);
}

WeightLayout& NetworkWeights::add(const std::string& name, uint32_t rows, uint32_t cols, DType dtype)
{
    weights_.push_back({state_.tensor(rows, cols, dtype, name), {}});
    return weights_.back();
}

Layer NetworkWeights::conv(const std::string& name, const ConvShape& s)
{
    const uint32_t taps = s.frames ? s.kernel : s.kernel * s.kernel, channels = s.channels + s.channels2;
    const uint32_t second = round_up(s.channels, kRowPadding), width = second + round_up(s.channels2, kRowPadding);
    WeightPart part{{name + ".weight", {s.outputs, channels, s.kernel, s.kernel}}, channels, straight(s.outputs), {}};
    if (s.frames)
        part.spec.shape = {s.outputs, channels, s.kernel, 1, 1};
    part.cols = straight(s.channels);
    if (s.channels2)
        part.cols.push_back({s.channels, second, s.channels2});
    part.taps = taps;
    part.tap_width = width;
    part.gain = s.gain;
    part.share = s.share;
    Layer layer;
    WeightLayout& weight = add(name + ".weight", s.outputs, taps * width, type_of(part.spec, s.dtype));
    layer.weight = weight.weight;
    weight.parts.push_back(std::move(part));
    WeightLayout& bias = add(name + ".bias", 1, s.outputs, DType::f32);
    layer.bias = bias.weight;
    bias.parts.push_back(vector_part(name + ".bias", s.outputs, straight(s.outputs), s.bias_gain));
    bias.parts.back().share = s.share;
    return layer;
}

Layer NetworkWeights::linear(const std::vector<Part>& parts, const LinearShape& s)
{
    uint32_t rows = 0;
    for (const Part& p : parts)
        rows += packed_rows(p);
    Layer layer;
    const std::string name = parts.front().name + ".weight";
    WeightLayout& weight = add(name, rows, s.col_heads ? padded_heads(s.cols, s.col_heads) : s.cols,
                               type_of({name, {rows, s.cols}}, s.dtype));
    layer.weight = weight.weight;
    uint32_t first = 0;
    for (const Part& p : parts) {
        WeightPart part{
            {p.name + ".weight", {p.rows, s.cols}}, s.cols, rows_of(p, first), of_heads(s.cols, s.col_heads)};
        if (p.conv)
            part.spec.shape.insert(part.spec.shape.end(), {1, 1});
        part.gain = s.gain;
        weight.parts.push_back(std::move(part));
        first += packed_rows(p);
    }
    if (!s.bias)
        return layer;
    WeightLayout& bias = add(parts.front().name + ".bias", 1, rows, DType::f32);
    layer.bias = bias.weight;
    first = 0;
    for (const Part& p : parts) {
        bias.parts.push_back(vector_part(p.name + ".bias", p.rows, rows_of(p, first), s.gain));
        first += packed_rows(p);
    }
    return layer;
}

Layer NetworkWeights::norm(const std::string& name, uint32_t channels)
{
    Layer layer;
    for (auto [slot, suffix] : {std::pair{&layer.weight, ".weight"}, std::pair{&layer.bias, ".bias"}}) {
        WeightLayout& weight = add(name + suffix, 1, channels, DType::f32);
        *slot = weight.weight;
        weight.parts.push_back(vector_part(name + suffix, channels, straight(channels), 1));
    }
    return layer;
}

DeviceTensor NetworkWeights::table(const std::string& name, uint32_t rows, uint32_t cols)
{
    WeightLayout& weight = add(name + ".weight", rows, cols, DType::f32);
    weight.parts.push_back({{name + ".weight", {rows, cols}}, cols, straight(rows), straight(cols)});
    return weight.weight;
}

DeviceTensor NetworkWeights::share(const FrameShare& share)
{
    WeightLayout& weight = add(share.mix_factor, 1, 1, DType::f32);
    weight.parts.push_back({{"", {1}}, 1, straight(1), straight(1)});
    weight.parts.back().share = share;
    return weight.weight;
}

Status NetworkWeights::load(Device& device, const Checkpoint& checkpoint, std::span<const TensorSpec> schema,
                            const LoadProgress& progress)
{
    SR_CHECK(checkpoint.require(schema));
    SR_CHECK(state_.allocate(device, "network weights"));
    const auto values = [&](const TensorSpec& spec, std::vector<float>& scratch) {
        return checkpoint.values(spec, scratch);
    };
    return load_weights(device, weights_, values, progress);
}

} // namespace semrover
