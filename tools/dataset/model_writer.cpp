// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/model_writer.h"

#include "engine/model/weight_blocks.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr const char* kWeights = "diffusion_pytorch_model";

uint64_t bytes_of(const TensorStream& tensor)
{
    uint64_t bytes = dtype_bytes(tensor.dtype);
    for (const uint64_t dim : tensor.shape)
        bytes *= dim;
    return bytes;
}

// in the order of the schema, each about as large as the others
Status write_shards(const Path& folder, std::span<const TensorStream> tensors, uint32_t shards)
{
    uint64_t total = 0, done = 0;
    for (const TensorStream& tensor : tensors)
        total += bytes_of(tensor);
    Json map = Json::object();
    size_t next = 0;
    for (uint32_t i = 0; i < shards; ++i) {
        const std::string file = fmt::format("{}-{:05}-of-{:05}.safetensors", kWeights, i + 1, shards);
        const size_t first = next;
        for (; next < tensors.size() && (i + 1 == shards || done < total / shards * (i + 1)); ++next) {
            done += bytes_of(tensors[next]);
            map[tensors[next].name] = file;
        }
        SR_CHECK(stream_safetensors(folder / file, tensors.subspan(first, next - first), {{"format", "pt"}}));
    }
    return write_json(folder / fmt::format("{}.safetensors.index.json", kWeights),
                      {{"metadata", {{"total_size", total}}}, {"weight_map", map}});
}

Status make_blocks(const TensorStream& weight, WeightBlocks& blocks)
{
    std::vector<std::byte> scratch;
    SR_TRY(const std::span<const std::byte> bytes, weight.bytes(scratch));
    std::vector<float> numbers(bytes.size() / dtype_bytes(weight.dtype));
    to_float(bytes, weight.dtype, numbers.data());
    uint32_t taps = 1;
    for (size_t i = 2; i < weight.shape.size(); ++i)
        taps *= uint32_t(weight.shape[i]);
    to_blocks(numbers, uint32_t(weight.shape[1]), taps, blocks);
    if (const auto bad = first_non_finite(std::as_bytes(std::span(blocks.scales)), DType::f16))
        return fail(ErrorCode::bad_input, "tensor {} is too large for fp16 scales, at block {}", quote(weight.name),
                    *bad);
    return {};
}

} // namespace

TensorStream block_values(const TensorStream& weight)
{
    const auto make = [weight](std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
        WeightBlocks blocks;
        SR_CHECK(make_blocks(weight, blocks));
        const auto bytes = std::as_bytes(std::span(blocks.values));
        scratch.assign(bytes.begin(), bytes.end());
        return std::span<const std::byte>(scratch);
    };
    return {weight.name, DType::i8, weight.shape, make};
}

TensorStream block_scales(const TensorStream& weight)
{
    const auto make = [weight](std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
        WeightBlocks blocks;
        SR_CHECK(make_blocks(weight, blocks));
        const auto bytes = std::as_bytes(std::span(blocks.scales));
        scratch.assign(bytes.begin(), bytes.end());
        return std::span<const std::byte>(scratch);
    };
    const TensorSpec scales = scales_of({weight.name, weight.shape});
    return {scales.name, DType::f16, scales.shape, make};
}

Status write_json(const Path& path, const Json& json)
{
    SR_CHECK(make_folder(path.parent_path()));
    return write_file_atomically(path, json_text(json, 2) + "\n");
}

Status write_component(const Path& folder, const ComponentFiles& files, uint32_t shards)
{
    SR_CHECK(make_folder(folder));
    if (shards > 1)
        SR_CHECK(write_shards(folder, files.tensors, shards));
    else
        SR_CHECK(
            stream_safetensors(folder / fmt::format("{}.safetensors", kWeights), files.tensors, {{"format", "pt"}}));
    return write_json(folder / "config.json", files.config);
}

TensorStream widen_conv_in(TensorStream conv_in, uint32_t channels)
{
    SR_ASSERT(conv_in.shape.size() == 4 && conv_in.shape[1] <= channels, "conv_in is {}", shape_text(conv_in.shape));
    const uint64_t rows = conv_in.shape[0], pixels = conv_in.shape[2] * conv_in.shape[3];
    const uint64_t from = conv_in.shape[1] * pixels * dtype_bytes(conv_in.dtype);
    const uint64_t to = channels * pixels * dtype_bytes(conv_in.dtype);
    const auto make = [source = conv_in.bytes, rows, from,
                       to](std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
        std::vector<std::byte> inner;
        SR_TRY(const std::span<const std::byte> bytes, source(inner));
        scratch.assign(rows * to, std::byte{0});
        for (uint64_t row = 0; row < rows; ++row)
            std::ranges::copy(bytes.subspan(row * from, from), scratch.begin() + std::ptrdiff_t(row * to));
        return std::span<const std::byte>(scratch);
    };
    conv_in.shape[1] = channels;
    conv_in.bytes = make;
    return conv_in;
}

std::vector<TensorStream> identity_quant_conv(uint32_t latent_channels, DType dtype)
{
    const uint32_t n = 2 * latent_channels;
    const auto stream = [&](const char* name, std::vector<uint64_t> shape, std::vector<float> values) {
        const auto make = [name, dtype, numbers = std::move(values)](
                              std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
            return encode_floats(numbers, dtype, name, scratch);
        };
        return TensorStream{name, dtype, std::move(shape), make};
    };
    std::vector<float> identity(size_t(n) * n, 0.f);
    for (uint32_t i = 0; i < n; ++i)
        identity[size_t(i) * n + i] = 1;
    return {stream("quant_conv.weight", {n, n, 1, 1}, std::move(identity)),
            stream("quant_conv.bias", {n}, std::vector<float>(n, 0.f))};
}

} // namespace semrover
