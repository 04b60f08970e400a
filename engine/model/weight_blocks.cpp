// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/weight_blocks.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint32_t kBlock = block_of(DType::q8_0).elements;
constexpr float kLargest = 127;

// of a block of every number a tap has: `number` gives each
template <typename Number>
float scale_of(const Number& number)
{
    float largest = 0;
    for (uint32_t i = 0; i < kBlock; ++i)
        largest = std::max(largest, std::abs(number(i)));
    return half_to_float(float_to_half(largest / kLargest));
}

// calls f(block, tap, first element of it), elements of a block are `taps` apart
template <typename F>
void for_blocks(size_t elements, uint32_t cols, uint32_t taps, F&& f)
{
    SR_ASSERT(cols % kBlock == 0 && elements % (size_t(cols) * taps) == 0, "{} elements in rows of {} by {}", elements,
              cols, taps);
    for (size_t b = 0; b < elements / (kBlock * taps); ++b)
        for (uint32_t tap = 0; tap < taps; ++tap)
            f(b * taps + tap, b * kBlock * taps + tap);
}

} // namespace

bool stored_in_blocks(std::string_view name, std::span<const uint64_t> shape)
{
    static constexpr std::string_view kParts[] = {"down_blocks.", "mid_block.", "up_blocks.", "transformer_blocks."};
    return shape.size() >= 2 && shape[1] % kBlock == 0 && name.ends_with(".weight") &&
           std::ranges::any_of(kParts, [&](std::string_view part) { return name.starts_with(part); });
}

TensorSpec scales_of(const TensorSpec& weight)
{
    TensorSpec scales{weight.name + "_scale", weight.shape, weight.optional, {DType::f16}};
    scales.shape[1] /= kBlock;
    return scales;
}

std::vector<TensorSpec> with_scales(std::vector<TensorSpec> schema)
{
    for (size_t i = 0, count = schema.size(); i < count; ++i)
        if (stored_in_blocks(schema[i].name, schema[i].shape)) {
            schema[i].dtypes = {DType::i8};
            schema.push_back(scales_of(schema[i]));
        }
    return schema;
}

void to_blocks(std::span<const float> numbers, uint32_t cols, uint32_t taps, WeightBlocks& blocks)
{
    blocks.values.resize(numbers.size());
    blocks.scales.resize(numbers.size() / kBlock);
    for_blocks(numbers.size(), cols, taps, [&](size_t block, size_t first) {
        const auto number = [&](uint32_t i) { return numbers[first + size_t(i) * taps]; };
        const float scale = scale_of(number), inverse = scale > 0 ? 1 / scale : 0;
        blocks.scales[block] = float_to_half(scale);
        for (uint32_t i = 0; i < kBlock; ++i) // what fp16 rounded down may make a little more than the largest
            blocks.values[first + size_t(i) * taps] =
                int8_t(std::nearbyint(std::clamp(number(i) * inverse, -kLargest, kLargest)));
    });
}

void from_blocks(std::span<const std::byte> values, std::span<const std::byte> scales, uint32_t cols, uint32_t taps,
                 std::vector<float>& numbers)
{
    numbers.resize(values.size());
    for_blocks(values.size(), cols, taps, [&](size_t block, size_t first) {
        float scale = 0;
        to_float(scales.subspan(2 * block, 2), DType::f16, &scale);
        for (uint32_t i = 0; i < kBlock; ++i) {
            const size_t at = first + size_t(i) * taps;
            numbers[at] = scale * float(int8_t(values[at]));
        }
    });
}

} // namespace semrover
