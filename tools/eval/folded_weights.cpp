// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/folded_weights.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

constexpr uint64_t kMaxOutputs = 8192;

uint32_t padded(const std::vector<uint32_t>& inputs)
{
    uint32_t sum = 0;
    for (const uint32_t n : inputs)
        sum += round_up(n, kRowPadding);
    return sum;
}

} // namespace

uint32_t FoldedWeights::add(const std::string& convolution, const std::string& norm, const Shape& shape)
{
    Layer layer{convolution, norm, shape, {}, {}};
    uint32_t& outputs = layer.shape.outputs;
    for (const std::string& name : {norm + ".running_mean", convolution + ".weight"}) // the latter if there is no norm
        if (const TensorInfo* t = file_.find(name);
            t && !t->shape.empty() && t->shape[0] >= 1 && t->shape[0] <= kMaxOutputs)
            outputs = uint32_t(t->shape[0]);
    const uint32_t inputs = std::accumulate(shape.inputs.begin(), shape.inputs.end(), 0u);
    schema_.push_back({convolution + ".weight", {outputs, inputs, shape.taps.height, shape.taps.width}});
    if (shape.bias)
        schema_.push_back({convolution + ".bias", {outputs}});
    if (!norm.empty()) {
        for (const char* name : {".weight", ".bias", ".running_mean", ".running_var"})
            schema_.push_back({norm + name, {outputs}});
        allow(norm + ".num_batches_tracked");
    }
    const uint32_t depth = shape.taps.height * shape.taps.width * padded(shape.inputs);
    layer.weight = state_.tensor(outputs, depth, DType::f32, convolution + ".weight");
    layer.bias = state_.tensor(1, outputs, DType::f32, convolution + ".bias");
    layers_.push_back(std::move(layer));
    return uint32_t(layers_.size() - 1);
}

void FoldedWeights::allow(const std::string& name)
{
    TensorSpec spec{name, {}, true};
    if (const TensorInfo* t = file_.find(name)) {
        spec.shape = t->shape;
        spec.dtypes = {t->dtype};
    }
    schema_.push_back(std::move(spec));
}

Status FoldedWeights::load(Device& device, std::string_view prefix)
{
    const auto there = [&](const TensorSpec& spec) { return !spec.optional && file_.find(spec.name); };
    if (std::ranges::none_of(schema_, there)) // not a list of all of them
        return fail(ErrorCode::bad_input, "{}: expected tensors such as '{}', found {} others: another kind of network",
                    quote_path(file_.path()), schema_.front().name, file_.tensors().size());
    SR_CHECK(file_.require(schema_, Unexpected::refuse, prefix));
    for (const TensorSpec& spec : schema_)
        if (!spec.optional)
            SR_CHECK(check_finite(file_, *file_.find(spec.name)));
    SR_CHECK(state_.allocate(device, "network weights"));
    std::vector<WeightLayout> weights;
    for (const Layer& layer : layers_)
        for (WeightLayout& w : layouts_of(layer))
            weights.push_back(std::move(w));
    size_t next = 0; // each layer's weight, then its bias
    return load_weights(device, weights, [&](const TensorSpec& spec, std::vector<float>& scratch) {
        const size_t part = next++;
        return fold(layers_[part / 2], part % 2, scratch).map([&] {
            return TensorValues{std::as_bytes(std::span(scratch)), DType::f32, file_.path(), spec.name};
        });
    });
}

Result<std::vector<double>> FoldedWeights::read(const std::string& name) const
{
    SR_TRY(const TensorInfo* t, file_.get(name));
    std::vector<float> values(t->elements());
    to_float(file_.bytes(*t), t->dtype, values.data());
    return std::vector<double>(values.begin(), values.end());
}

std::array<WeightLayout, 2> FoldedWeights::layouts_of(const Layer& layer)
{
    const Shape& s = layer.shape;
    const uint32_t channels = std::accumulate(s.inputs.begin(), s.inputs.end(), 0u);
    WeightPart weight{{layer.convolution + ".weight", {s.outputs, channels, s.taps.height, s.taps.width}},
                      channels,
                      straight(s.outputs),
                      {}};
    weight.taps = s.taps.height * s.taps.width;
    weight.tap_width = padded(s.inputs);
    uint32_t from = 0, to = 0;
    for (const uint32_t of_branch : s.inputs) {
        weight.cols.push_back({from, to, of_branch});
        from += of_branch;
        to += round_up(of_branch, kRowPadding);
    }
    const WeightPart bias{{layer.convolution + ".bias", {s.outputs}}, s.outputs, straight(1), straight(s.outputs)};
    return {WeightLayout{layer.weight, {weight}}, {layer.bias, {bias}}};
}

Status FoldedWeights::fold(const Layer& layer, bool of_bias, std::vector<float>& values) const
{
    std::vector<double> numbers(layer.shape.outputs);
    if (!of_bias || layer.shape.bias) {
        SR_TRY(numbers, read(layer.convolution + (of_bias ? ".bias" : ".weight")));
    }
    if (!layer.norm.empty())
        SR_CHECK(apply_norm(layer, of_bias, numbers));
    values.assign(numbers.begin(), numbers.end());
    return {};
}

Status FoldedWeights::apply_norm(const Layer& layer, bool of_bias, std::vector<double>& numbers) const
{
    const Shape& s = layer.shape;
    SR_TRY(const auto gain, read(layer.norm + ".weight"));
    SR_TRY(const auto variance, read(layer.norm + ".running_var"));
    std::vector<double> scale(s.outputs);
    for (uint32_t n = 0; n < s.outputs; ++n) {
        if (variance[n] < 0)
            return fail(ErrorCode::bad_input, "{}: tensor '{}.running_var' holds {} at element {}",
                        quote_path(file_.path()), printable(layer.norm), variance[n], n);
        scale[n] = gain[n] / std::sqrt(variance[n] + s.eps);
    }
    if (of_bias) {
        SR_TRY(const auto beta, read(layer.norm + ".bias"));
        SR_TRY(const auto mean, read(layer.norm + ".running_mean"));
        for (uint32_t n = 0; n < s.outputs; ++n)
            numbers[n] = (numbers[n] - mean[n]) * scale[n] + beta[n];
        return {};
    }
    const size_t of_output = numbers.size() / s.outputs;
    for (size_t i = 0; i < numbers.size(); ++i)
        numbers[i] *= scale[i / of_output];
    return {};
}

} // namespace semrover
