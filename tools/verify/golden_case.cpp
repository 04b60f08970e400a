// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/verify/golden_case.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace semrover {

Result<GoldenCase> GoldenCase::open(const Path& folder)
{
    SR_TRY(const std::string text, read_text_file(folder / "case.json", 1 << 20));
    const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object() || !json.value("kind", nlohmann::json()).is_string())
        return fail(ErrorCode::bad_input, "{}: expected an object with a kind", (folder / "case.json").string());
    SR_TRY(Safetensors tensors, Safetensors::open(folder / "tensors.safetensors"));
    GoldenCase c(std::move(tensors));
    c.folder_ = folder;
    c.name_ = folder.filename().empty() ? folder.parent_path().filename().string() : folder.filename().string();
    c.kind_ = json["kind"];
    const nlohmann::json model = json.value("model", nlohmann::json());
    c.model_ = model.is_string() ? model.get<std::string>() : "model";
    c.params_ = json.value("params", nlohmann::json::object());
    c.tolerance_ = json.value("tolerance", nlohmann::json::object());
    if (!c.params_.is_object() || !c.tolerance_.is_object())
        return fail(ErrorCode::bad_input, "{}: params and tolerance must be objects", (folder / "case.json").string());
    for (const nlohmann::json& number : c.tolerance_)
        if (!number.is_number())
            return fail(ErrorCode::bad_input, "{}: tolerance must hold numbers", (folder / "case.json").string());
    return c;
}

std::vector<uint64_t> GoldenCase::shape(const std::string& tensor) const
{
    const TensorInfo* info = tensors_.find(tensor);
    return info ? info->shape : std::vector<uint64_t>{};
}

namespace {

template <typename T, typename Source>
void convert(std::span<const std::byte> bytes, std::vector<T>& out)
{
    out.resize(bytes.size() / sizeof(Source));
    for (size_t i = 0; i < out.size(); ++i) {
        Source v;
        std::memcpy(&v, &bytes[i * sizeof(Source)], sizeof(Source));
        out[i] = T(v);
    }
}

template <typename T>
std::vector<T> elements(const Safetensors& file, const std::string& name)
{
    std::vector<T> out;
    const TensorInfo* info = file.find(name);
    if (!info)
        return out;
    const auto bytes = file.bytes(*info);
    switch (info->dtype) {
    case DType::f32:
        convert<T, float>(bytes, out);
        break;
    case DType::f64:
        convert<T, double>(bytes, out);
        break;
    case DType::i32:
        convert<T, int32_t>(bytes, out);
        break;
    case DType::u32:
        convert<T, uint32_t>(bytes, out);
        break;
    case DType::i64:
        convert<T, int64_t>(bytes, out);
        break;
    case DType::u8:
    case DType::boolean:
        convert<T, uint8_t>(bytes, out);
        break;
    default:
        break;
    }
    return out;
}

} // namespace

std::vector<float> GoldenCase::floats(const std::string& tensor) const
{
    return elements<float>(tensors_, tensor);
}
std::vector<int64_t> GoldenCase::integers(const std::string& tensor) const
{
    return elements<int64_t>(tensors_, tensor);
}

Result<double> GoldenCase::number(const char* param) const
{
    if (!params_.contains(param) || !params_[param].is_number())
        return fail(ErrorCode::bad_input, "{}: case.json has no number '{}'", name_, param);
    return params_[param].get<double>();
}

std::vector<std::string> GoldenCase::expected() const
{
    std::vector<std::string> names;
    for (const TensorInfo& t : tensors_.tensors())
        if (t.name.rfind("expect.", 0) == 0)
            names.push_back(t.name.substr(7));
    return names;
}

namespace {

void compare_floats(const GoldenCase& c, const std::string& name, const GoldenOutputs& got, double tolerance,
                    GoldenVerdict& v)
{
    const std::vector<float> expect = c.floats("expect." + name);
    const std::vector<float>& values = got.floats.at(name);
    if (values.size() != expect.size()) {
        v.reason = fmt::format("{}: {} elements, expected {}", name, values.size(), expect.size());
        return;
    }
    const auto ignored = got.ignored.find(name);
    double scale = 1;
    for (float e : expect)
        scale = std::max(scale, double(std::abs(e)));
    std::vector<double> errors;
    for (size_t i = 0; i < expect.size(); ++i) {
        if (ignored != got.ignored.end() && ignored->second[i])
            continue;
        const double error = std::abs(double(values[i]) - expect[i]) / scale;
        errors.push_back(std::isfinite(error) ? error : INFINITY);
    }
    std::sort(errors.begin(), errors.end());
    const size_t outliers = size_t(c.outlier_fraction() * double(errors.size()));
    if (errors.empty())
        return;
    if (outliers && errors.back() > tolerance * c.outlier_factor())
        v.reason = fmt::format("{}: an outlier is off by {:.3g}", name, errors.back());
    v.max_error = std::max(v.max_error, errors[errors.size() - 1 - outliers]);
}

void compare_integers(const GoldenCase& c, const std::string& name, const GoldenOutputs& got, GoldenVerdict& v)
{
    const std::vector<int64_t> expect = c.integers("expect." + name);
    const std::vector<int64_t>& values = got.integers.at(name);
    if (values.size() != expect.size()) {
        v.reason = fmt::format("{}: {} elements, expected {}", name, values.size(), expect.size());
        return;
    }
    for (size_t i = 0; i < expect.size(); ++i)
        if (values[i] != expect[i]) {
            v.reason = fmt::format("{}[{}] is {}, expected {}", name, i, values[i], expect[i]);
            return;
        }
}

} // namespace

GoldenVerdict compare(const GoldenCase& c, const GoldenOutputs& got, const std::string& precision)
{
    GoldenVerdict v;
    const double tolerance = c.tolerance(precision);
    for (const std::string& name : c.expected()) {
        if (got.floats.count(name))
            compare_floats(c, name, got, tolerance, v);
        else if (got.integers.count(name))
            compare_integers(c, name, got, v);
        else
            v.reason = fmt::format("no output '{}'", name);
    }
    if (c.expected().empty())
        v.reason = "the case expects nothing";
    v.passed = v.reason.empty() && v.max_error <= tolerance;
    return v;
}

} // namespace semrover
