// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/network_weights.h"

#include <cmath>
#include <map>

namespace semrover {

namespace {

// where a row of the file goes in its part
uint32_t packed_row(uint32_t row, uint32_t rows, uint32_t heads, bool geglu)
{
    if (geglu) {
        const uint32_t half = rows / 2, in_half = row % half;
        return in_half / 8 * 16 + in_half % 8 + (row >= half ? 8 : 0);
    }
    if (!heads)
        return row;
    const uint32_t size = rows / heads;
    return row / size * round_up(size, kRowPadding) + row % size;
}

uint32_t packed_rows(uint32_t rows, uint32_t heads, bool geglu)
{
    return geglu ? 2 * round_up(rows / 2, kRowPadding) : heads ? padded_heads(rows, heads) : rows;
}

float share_of(float mix_factor, bool switched)
{
    const double alpha = 1 / (1 + std::exp(-double(mix_factor)));
    return float(switched ? alpha : 1 - alpha);
}

} // namespace

NetworkWeights::Entry& NetworkWeights::add(const std::string& name, uint32_t rows, uint32_t cols, DType dtype)
{
    entries_.push_back({state_.slot(rows, cols, dtype, name), {}});
    return entries_.back();
}

void NetworkWeights::add_vector(Entry& entry, const std::string& name, uint32_t size, uint32_t first, uint32_t heads,
                                bool geglu, float gain)
{
    entry.sources.push_back({{name, {size}},
                             [=](std::span<const float> values, float* row, uint32_t) {
                                 for (uint32_t i = 0; i < size; ++i)
                                     row[first + packed_row(i, size, heads, geglu)] = gain * values[i];
                             },
                             {}});
}

Layer NetworkWeights::conv(const std::string& name, const ConvShape& s)
{
    const uint32_t taps = s.frames ? s.kernel : s.kernel * s.kernel, channels = s.channels + s.channels2;
    const uint32_t first = round_up(s.channels, kRowPadding), width = first + round_up(s.channels2, kRowPadding);
    Layer layer;
    Entry& weight = add(name + ".weight", s.outputs, taps * width, s.dtype.value_or(precision_));
    layer.weight = weight.weight;
    const auto pack = [=](std::span<const float> values, float* rows, uint32_t ld) {
        for (uint32_t n = 0; n < s.outputs; ++n)
            for (uint32_t c = 0; c < channels; ++c) {
                const float* from = &values[(size_t(n) * channels + c) * taps];
                float* to = rows + size_t(n) * ld + (c < s.channels ? c : first + c - s.channels);
                for (uint32_t tap = 0; tap < taps; ++tap)
                    to[tap * width] = s.gain * from[tap];
            }
    };
    std::vector<uint64_t> shape{s.outputs, channels, s.kernel, s.kernel};
    if (s.frames)
        shape = {s.outputs, channels, s.kernel, 1, 1};
    weight.sources.push_back({{name + ".weight", shape}, pack, s.share});
    Entry& bias = add(name + ".bias", 1, s.outputs, DType::f32);
    layer.bias = bias.weight;
    add_vector(bias, name + ".bias", s.outputs, 0, 0, false, s.bias_gain);
    bias.sources.back().share = s.share;
    return layer;
}

Layer NetworkWeights::linear(const std::vector<Part>& parts, const LinearShape& s)
{
    uint32_t rows = 0;
    for (const Part& p : parts)
        rows += packed_rows(p.rows, p.heads, p.geglu);
    Layer layer;
    Entry& weight = add(parts.front().name + ".weight", rows, s.col_heads ? padded_heads(s.cols, s.col_heads) : s.cols,
                        s.dtype.value_or(precision_));
    layer.weight = weight.weight;
    uint32_t first = 0;
    for (const Part& p : parts) {
        const auto pack = [=](std::span<const float> values, float* to, uint32_t ld) {
            for (uint32_t r = 0; r < p.rows; ++r) {
                float* row = to + size_t(first + packed_row(r, p.rows, p.heads, p.geglu)) * ld;
                for (uint32_t c = 0; c < s.cols; ++c)
                    row[packed_row(c, s.cols, s.col_heads, false)] = s.gain * values[size_t(r) * s.cols + c];
            }
        };
        std::vector<uint64_t> shape{p.rows, s.cols};
        if (p.conv)
            shape.insert(shape.end(), {1, 1});
        weight.sources.push_back({{p.name + ".weight", shape}, pack, {}});
        first += packed_rows(p.rows, p.heads, p.geglu);
    }
    if (!s.bias)
        return layer;
    Entry& bias = add(parts.front().name + ".bias", 1, rows, DType::f32);
    layer.bias = bias.weight;
    first = 0;
    for (const Part& p : parts) {
        add_vector(bias, p.name + ".bias", p.rows, first, p.heads, p.geglu, s.gain);
        first += packed_rows(p.rows, p.heads, p.geglu);
    }
    return layer;
}

Layer NetworkWeights::norm(const std::string& name, uint32_t channels)
{
    Layer layer;
    for (auto [weight, suffix] : {std::pair{&layer.weight, ".weight"}, std::pair{&layer.bias, ".bias"}}) {
        Entry& entry = add(name + suffix, 1, channels, DType::f32);
        *weight = entry.weight;
        add_vector(entry, name + suffix, channels, 0, 0, false, 1);
    }
    return layer;
}

Slot NetworkWeights::table(const std::string& name, uint32_t rows, uint32_t cols)
{
    Entry& entry = add(name + ".weight", rows, cols, DType::f32);
    const auto pack = [=](std::span<const float> values, float* to, uint32_t ld) {
        for (uint32_t r = 0; r < rows; ++r)
            std::copy_n(&values[size_t(r) * cols], cols, to + size_t(r) * ld);
    };
    entry.sources.push_back({{name + ".weight", {rows, cols}}, pack, {}});
    return entry.weight;
}

Slot NetworkWeights::share(const FrameShare& share)
{
    Entry& entry = add(share.mix_factor, 1, 1, DType::f32);
    const auto pack = [switched = share.switched](std::span<const float> values, float* to, uint32_t) {
        *to = share_of(values[0], switched);
    };
    entry.sources.push_back({{share.mix_factor, {1}}, pack, {}});
    return entry.weight;
}

uint64_t NetworkWeights::parameters() const
{
    std::map<std::string, uint64_t> sizes;
    for (const Entry& entry : entries_)
        for (const Source& source : entry.sources) {
            uint64_t& size = sizes[source.spec.name] = 1;
            for (uint64_t n : source.spec.shape)
                size *= n;
            if (source.share)
                sizes[source.share->mix_factor] = 1;
        }
    uint64_t sum = 0;
    for (const auto& [name, size] : sizes)
        sum += size;
    return sum;
}

Status NetworkWeights::read(const Checkpoint& checkpoint, const Source& source, std::vector<float>& values) const
{
    SR_CHECK(checkpoint.read(source.spec, values));
    if (!source.share)
        return {};
    std::vector<float> mix;
    SR_CHECK(checkpoint.read({source.share->mix_factor, {1}}, mix));
    const float share = share_of(mix.front(), source.share->switched);
    for (float& value : values)
        value *= share;
    return {};
}

Status NetworkWeights::upload(Device& device, const Checkpoint& checkpoint, const Entry& entry, Scratch& scratch) const
{
    const uint32_t ld = entry.weight.ld();
    scratch.rows.assign(size_t(entry.weight.rows()) * ld, 0.f);
    for (const Source& source : entry.sources) {
        SR_CHECK(read(checkpoint, source, scratch.values));
        source.pack(scratch.values, scratch.rows.data(), ld);
    }
    const DType dtype = entry.weight.dtype();
    scratch.bytes.resize(scratch.rows.size() * dtype_bytes(dtype));
    from_float(scratch.rows, dtype, scratch.bytes.data());
    if (const auto bad = first_non_finite(scratch.bytes, dtype))
        return fail(ErrorCode::bad_input, "tensor '{}' holds {}, which {} cannot hold: use `precision` fp32",
                    entry.sources.front().spec.name, scratch.rows[*bad], dtype_name(dtype));
    return entry.weight.write(device, scratch.bytes);
}

Status NetworkWeights::load(Device& device, const Checkpoint& checkpoint, std::span<const TensorSpec> schema,
                            const LoadProgress& progress)
{
    SR_CHECK(checkpoint.require(schema));
    SR_CHECK(state_.allocate(device, "network weights"));
    Scratch scratch;
    for (const Entry& entry : entries_) {
        SR_CHECK(upload(device, checkpoint, entry, scratch));
        if (progress)
            SR_CHECK(progress(entry.weight.bytes()));
    }
    return {};
}

} // namespace semrover
