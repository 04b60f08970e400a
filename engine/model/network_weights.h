// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"
#include "engine/model/weight_loader.h"

namespace semrover {

// a layer of a network: its packed weight, and its bias in fp32, or none
struct Layer {
    DeviceTensor weight, bias;
};

// Parameters in device memory, in the layouts that the kernels read. First every layer is declared, then all of them
// are read from a checkpoint; what is declared decides the device bytes.
class NetworkWeights {
  public:
    // blocks: weights that can be are q8_0 (weight_blocks.h), as in the file
    explicit NetworkWeights(DType precision, bool blocks = false) : precision_(precision), blocks_(blocks) {}

    DType precision() const { return precision_; }

    DeviceTensor share(const FrameShare& share); // [1, 1] fp32

    // convolution over C channels, or C and C2 that come as two inputs: [N, kernel^2 * (C + C2)], tap by tap, each
    // input padded to kRowPadding. `gain` multiplies weights, `bias_gain` biases. Without a dtype: the network's
    // precision. What can be in blocks is, whatever the dtype.
    struct ConvShape {
        uint32_t outputs, channels, channels2 = 0, kernel = 3;
        float gain = 1, bias_gain = 1;
        std::optional<DType> dtype = {};
        bool frames = false;                  // taps along time only: [N, C, kernel, 1, 1] in the file
        std::optional<FrameShare> share = {}; // multiplies weights and biases, too
    };
    Layer conv(const std::string& name, const ConvShape& shape);

    // matrices stacked in rows: [sum of N, K], each part with rows or columns spread over padded heads
    struct Part {
        std::string name;   // without .weight and .bias
        uint32_t rows;      // N, as in the file
        uint32_t heads = 0; // rows are that many heads, each padded to kRowPadding; 0: rows as they are
        bool geglu = false; // rows are values, then gates: interleaved in blocks of eight
        bool conv = false;  // stored as a 1x1 convolution [N, K, 1, 1]
    };
    struct LinearShape {
        uint32_t cols; // K, as in the file
        bool bias = true;
        uint32_t col_heads = 0; // columns are heads, padded likewise
        float gain = 1;         // of weights and biases
        std::optional<DType> dtype = {};
    };
    Layer linear(const std::vector<Part>& parts, const LinearShape& shape);

    Layer norm(const std::string& name, uint32_t channels);                    // weight and bias, [1, channels] fp32
    DeviceTensor table(const std::string& name, uint32_t rows, uint32_t cols); // an embedding, fp32

    uint64_t parameters() const { return parameters_of(weights_); } // as in the file
    uint64_t device_bytes(const DeviceLimits& limits) const { return state_.planned_bytes(limits); }
    Status load(Device& device, const Checkpoint& checkpoint, std::span<const TensorSpec> schema,
                const LoadProgress& progress = {});

  private:
    WeightLayout& add(const std::string& name, uint32_t rows, uint32_t cols, DType dtype);

    DType type_of(const TensorSpec& weight, std::optional<DType> other) const;

    DType precision_;
    bool blocks_;
    TensorPool state_;
    std::vector<WeightLayout> weights_;
};

// rows of heads after padding each
constexpr uint32_t padded_heads(uint32_t rows, uint32_t heads)
{
    return heads * round_up(rows / heads, kRowPadding);
}

} // namespace semrover
