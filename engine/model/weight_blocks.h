// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/safetensors.h"

// Weights of 8 bits, q8_0: 32 inputs of an output, at a tap, are a block, int8 that share a scale. In a file
// NAME.weight is I8 in its own shape, and NAME.weight_scale F16 in that shape with a 32nd of the inputs (docs/models.md
// §2.1).
namespace semrover {

// Is this tensor stored so, in a network whose config says `"weights": "q8_0"`? Matrices and convolutions of its blocks
// are, where the inputs of a tap are whole blocks. What stays as it is: norms, biases and factors; first and last
// layers and embeddings, whose errors all that follows sees; VAEs. It is little memory.
bool stored_in_blocks(std::string_view name, std::span<const uint64_t> shape);

TensorSpec scales_of(const TensorSpec& weight);
inline bool is_scales(std::string_view tensor)
{
    return tensor.ends_with(".weight_scale");
}
// the schema of such a network
std::vector<TensorSpec> with_scales(std::vector<TensorSpec> schema);

// numbers [rows, cols, taps] as files have them, in blocks: as many int8, and fp16 scales [rows, cols / 32, taps],
// which are infinite where numbers are beyond 8e6
struct WeightBlocks {
    std::vector<int8_t> values;
    std::vector<uint16_t> scales;
};
void to_blocks(std::span<const float> numbers, uint32_t cols, uint32_t taps, WeightBlocks& blocks);
// and back; as many numbers as int8
void from_blocks(std::span<const std::byte> values, std::span<const std::byte> scales, uint32_t cols, uint32_t taps,
                 std::vector<float>& numbers);

} // namespace semrover
