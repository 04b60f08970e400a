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
    for (const std::string& name : {norm + ".running_mean", convolution + ".weight"})
        if (const TensorInfo* t = file_.find(name);
            t && !t->shape.empty() && t->shape[0] >= 1 && t->shape[0] <= kMaxOutputs)
            outputs = uint32_t(t->shape[0]);
    const uint32_t inputs = std::accumulate(shape.inputs.begin(), shape.inputs.end(), 0u);
    schema_.push_back({convolution + ".weight", {outputs, inputs, shape.taps.height, shape.taps.width}});
    if (shape.bias)
        schema_.push_back({convolution + ".bias", {outputs}});
    for (const char* name : {".weight", ".bias", ".running_mean", ".running_var"})
        schema_.push_back({norm + name, {outputs}});
    allow(norm + ".num_batches_tracked");
    const uint32_t depth = shape.taps.height * shape.taps.width * padded(shape.inputs);
    layer.weight = state_.slot(outputs, depth, DType::f32, convolution + ".weight");
    layer.bias = state_.slot(1, outputs, DType::f32, convolution + ".bias");
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
    for (const Layer& layer : layers_)
        SR_CHECK(upload(device, layer));
    return {};
}

Result<std::vector<double>> FoldedWeights::read(const std::string& name) const
{
    SR_TRY(const TensorInfo* t, file_.get(name));
    std::vector<float> values(t->elements());
    to_float(file_.bytes(*t), t->dtype, values.data());
    return std::vector<double>(values.begin(), values.end());
}

Status FoldedWeights::upload(Device& device, const Layer& layer) const
{
    const Shape& s = layer.shape;
    SR_TRY(const auto weight, read(layer.convolution + ".weight"));
    SR_TRY(const auto gain, read(layer.norm + ".weight"));
    SR_TRY(const auto beta, read(layer.norm + ".bias"));
    SR_TRY(const auto mean, read(layer.norm + ".running_mean"));
    SR_TRY(const auto variance, read(layer.norm + ".running_var"));
    std::vector<double> bias(s.outputs);
    if (s.bias) {
        SR_TRY(bias, read(layer.convolution + ".bias"));
    }
    const uint32_t taps = s.taps.height * s.taps.width, width = padded(s.inputs);
    const uint32_t channels = std::accumulate(s.inputs.begin(), s.inputs.end(), 0u);
    std::vector<float> rows(size_t(s.outputs) * layer.weight.cols()), shifts(round_up(s.outputs, kRowPadding));
    for (uint32_t n = 0; n < s.outputs; ++n) {
        if (variance[n] < 0)
            return fail(ErrorCode::bad_input, "{}: tensor '{}.running_var' holds {} at element {}",
                        quote_path(file_.path()), printable(layer.norm), variance[n], n);
        const double scale = gain[n] / std::sqrt(variance[n] + s.eps);
        shifts[n] = float((bias[n] - mean[n]) * scale + beta[n]);
        uint32_t channel = 0, first = 0;
        for (const uint32_t of_branch : s.inputs) {
            for (uint32_t c = 0; c < of_branch; ++c, ++channel)
                for (uint32_t tap = 0; tap < taps; ++tap)
                    rows[size_t(n) * layer.weight.cols() + tap * width + first + c] =
                        float(weight[(size_t(n) * channels + channel) * taps + tap] * scale);
            first += round_up(of_branch, kRowPadding);
        }
    }
    SR_CHECK(layer.weight.write(device, rows));
    return layer.bias.write(device, shifts);
}

} // namespace semrover
