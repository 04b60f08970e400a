// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/features.h"

#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace semrover {

namespace {

const std::vector<DType> kFloats = {DType::f32, DType::f16, DType::bf16, DType::f64};

// a tensor's numbers; what a NaN is, and where, is said in rows and columns
Result<std::vector<double>> read_numbers(const SafetensorsSet& file, const TensorInfo& t)
{
    const std::span<const std::byte> bytes = file.bytes(t);
    std::vector<double> values(t.elements());
    if (t.dtype == DType::f64) {
        std::memcpy(values.data(), bytes.data(), bytes.size());
    } else {
        std::vector<float> floats(values.size());
        to_float(bytes, t.dtype, floats.data());
        std::copy(floats.begin(), floats.end(), values.begin());
    }
    const auto bad = std::find_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); });
    if (bad != values.end()) {
        const uint64_t at = uint64_t(bad - values.begin()), cols = t.shape.back();
        return fail(ErrorCode::bad_input, "{}: tensor '{}' holds {} in row {}, column {}", quote_path(file.path()),
                    t.name, *bad, at / cols, at % cols);
    }
    return values;
}

std::string shape_text(const std::vector<uint64_t>& shape)
{
    return fmt::format("[{}]", fmt::join(shape, ", "));
}

Status check_size(const SafetensorsSet& file, uint64_t size)
{
    if (size < 1 || size > kMaxFeatures)
        return fail(ErrorCode::bad_input, "{}: {} features a sample, expected 1 to {}", quote_path(file.path()), size,
                    kMaxFeatures);
    return {};
}

} // namespace

Result<FeatureFile> feature_file_kind(const Path& path)
{
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open(path));
    if (file.find("features"))
        return FeatureFile::features;
    if (file.find("mu") && file.find("sigma"))
        return FeatureFile::gaussian;
    return fail(ErrorCode::bad_input,
                "{}: expected a tensor 'features' [N, D], or 'mu' [D] and 'sigma' [D, D]; found {} other tensors",
                quote_path(path), file.tensors().size());
}

Result<Features> read_features(const Path& path)
{
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open(path));
    const TensorInfo* t = file.find("features");
    std::vector<uint64_t> shape = t && t->shape.size() == 2 ? t->shape : std::vector<uint64_t>{1, 1};
    if (t && t->shape.size() != 2)
        return fail(ErrorCode::bad_input, "{}: tensor 'features' is {}, expected [N, D]", quote_path(path),
                    shape_text(t->shape));
    const TensorSpec spec{"features", shape, false, kFloats};
    SR_CHECK(file.require({&spec, 1}));
    SR_CHECK(check_size(file, shape[1]));
    if (shape[0] < 1 || shape[0] > UINT32_MAX)
        return fail(ErrorCode::bad_input, "{}: features of {} samples", quote_path(path), shape[0]);
    Features f{uint32_t(shape[0]), uint32_t(shape[1]), {}, {}};
    const auto& metadata = file.shards().front().metadata();
    if (const auto network = metadata.find("network"); network != metadata.end())
        f.network = network->second;
    SR_TRY(f.values, read_numbers(file, *t));
    return f;
}

Status write_features(const Path& path, const Features& features)
{
    const std::vector<float> values(features.values.begin(), features.values.end());
    const TensorData data{"features", DType::f32, {features.rows, features.cols}, std::as_bytes(std::span(values))};
    std::map<std::string, std::string> metadata;
    if (!features.network.empty())
        metadata["network"] = features.network;
    return write_safetensors(path, {&data, 1}, metadata);
}

Result<Gaussian> read_gaussian(const Path& path)
{
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open(path));
    const TensorInfo* mu = file.find("mu");
    const uint64_t size = mu && mu->shape.size() == 1 ? mu->shape[0] : 1;
    const std::vector<TensorSpec> schema = {{"mu", {size}, false, kFloats}, {"sigma", {size, size}, false, kFloats}};
    SR_CHECK(file.require(schema));
    SR_CHECK(check_size(file, size));
    Gaussian g;
    g.size = uint32_t(size);
    SR_TRY(g.mean, read_numbers(file, *mu));
    SR_TRY(g.covariance, read_numbers(file, *file.find("sigma")));
    double largest = 0;
    for (double v : g.covariance)
        largest = std::max(largest, std::abs(v));
    for (uint64_t i = 0; i < size; ++i) {
        if (g.covariance[i * size + i] < 0)
            return fail(ErrorCode::bad_input, "{}: sigma has the negative variance {} at {}", quote_path(path),
                        g.covariance[i * size + i], i);
        for (uint64_t j = 0; j < i; ++j) {
            double &a = g.covariance[i * size + j], &b = g.covariance[j * size + i];
            if (std::abs(a - b) > 1e-3 * largest)
                return fail(ErrorCode::bad_input, "{}: sigma is not symmetric: {} at {}, {} and {} at {}, {}",
                            quote_path(path), a, i, j, b, j, i);
            a = b = (a + b) / 2;
        }
    }
    return g;
}

} // namespace semrover
