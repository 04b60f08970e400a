// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/low_rank.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr std::string_view kDown = ".lora_A.weight", kUp = ".lora_B.weight", kWeight = ".weight";

std::vector<float> floats(const SafetensorsSet& file, const TensorInfo& tensor)
{
    std::vector<float> values(tensor.elements());
    to_float(file.bytes(tensor), tensor.dtype, values.data());
    return values;
}

// the layer that a tensor is of, or nothing
std::string layer_of(std::string_view name, std::string_view suffix)
{
    return name.ends_with(suffix) ? std::string(name.substr(0, name.size() - suffix.size())) : std::string();
}

bool is_matrix(const TensorInfo& tensor)
{
    constexpr std::array kTypes = {DType::f32, DType::f16, DType::bf16};
    return tensor.shape.size() == 2 && tensor.elements() > 0 && std::ranges::find(kTypes, tensor.dtype) != kTypes.end();
}

} // namespace

Result<std::string> preset_adapter(const Json& preset)
{
    const auto found = preset.find("adapter");
    if (found == preset.end() || found->is_null())
        return kAdapterFile;
    const std::string name = found->is_string() ? found->get<std::string>() : std::string();
    if (name.empty() || name.find_first_of("/\\") != std::string::npos)
        return fail(ErrorCode::bad_input, "model_index.json: presets: adapter: expected the name of a file");
    return name;
}

Result<LowRankAdapter> LowRankAdapter::open(const Path& path)
{
    LowRankAdapter adapter;
    if (!is_there(path))
        return adapter;
    SR_TRY(SafetensorsSet file, SafetensorsSet::open(path));
    SR_CHECK(check_finite(file));
    std::vector<std::string> odd;
    for (const TensorInfo& tensor : file.tensors()) {
        const std::string of_up = layer_of(tensor.name, kUp), layer = layer_of(tensor.name, kDown);
        const TensorInfo* up = layer.empty() ? nullptr : file.find(layer + std::string(kUp));
        if (!of_up.empty() && file.find(of_up + std::string(kDown)))
            continue;
        if (!up || !is_matrix(tensor) || !is_matrix(*up) || tensor.shape[0] != up->shape[1]) {
            odd.push_back(quote(tensor.name));
            continue;
        }
        adapter.pairs_[layer + std::string(kWeight)] = {uint32_t(tensor.shape[0]), floats(file, tensor),
                                                        floats(file, *up)};
    }
    if (!odd.empty())
        return fail(ErrorCode::bad_input,
                    "{}: expected pairs NAME.lora_A.weight [r, K] and NAME.lora_B.weight [N, r]; found beside them {}",
                    quote_path(file.path()), fmt::join(odd, ", "));
    adapter.path_ = file.path();
    return adapter;
}

Status LowRankAdapter::require(std::span<const TensorSpec> schema) const
{
    std::vector<std::string> odd;
    for (const auto& [name, pair] : pairs_) {
        const auto spec = std::ranges::find(schema, name, &TensorSpec::name);
        const uint64_t rows = pair.up.size() / pair.rank, cols = pair.down.size() / pair.rank;
        if (spec == schema.end())
            odd.push_back(fmt::format("there is no matrix {}", quote(name)));
        else if (!std::ranges::equal(spec->shape, std::array{rows, cols}))
            odd.push_back(fmt::format("{} is [{}], the adapter's is [{}, {}]", quote(name),
                                      fmt::join(spec->shape, ", "), rows, cols));
    }
    if (!odd.empty())
        return fail(ErrorCode::bad_input, "{}: {}", quote_path(path_), fmt::join(odd, "; "));
    return {};
}

void LowRankAdapter::add(const std::string& name, std::span<float> values) const
{
    const Pair& pair = pairs_.at(name);
    const size_t cols = pair.down.size() / pair.rank;
    for (size_t row = 0; row < values.size() / cols; ++row)
        for (uint32_t r = 0; r < pair.rank; ++r) {
            const float up = pair.up[row * pair.rank + r];
            for (size_t c = 0; c < cols; ++c)
                values[row * cols + c] += up * pair.down[r * cols + c];
        }
}

} // namespace semrover
