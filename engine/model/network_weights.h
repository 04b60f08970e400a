// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"
#include "engine/model/load_progress.h"
#include "runtime/device/device.h"
#include "runtime/device/state.h"

#include <functional>

namespace semrover {

// a layer of a network: its packed weight, and its bias in fp32, or none
struct Layer {
    Slot weight, bias;
};

// Parameters in device memory, in the layouts that the kernels read. First every layer is declared, then all of them
// are read from a checkpoint; what is declared decides the device bytes.
class NetworkWeights {
  public:
    // limits: of the device that the graphs are for, which decide how they convolve
    NetworkWeights(DType precision, const DeviceLimits& limits) : precision_(precision), limits_(limits) {}

    DType precision() const { return precision_; }
    const DeviceLimits& limits() const { return limits_; }

    // The share of what a video's frames make together, against what each makes alone: sigmoid(mix) or, as diffusers'
    // AlphaBlender has it unless it is switched, 1 - sigmoid(mix)
    struct FrameShare {
        std::string mix_factor; // the tensor's name
        bool switched = false;
    };
    Slot share(const FrameShare& share); // [1, 1] fp32

    // convolution over C channels, or C and C2 that come as two inputs: [N, kernel^2 * (C + C2)], tap by tap, each
    // input padded to kRowPadding. `gain` multiplies weights, `bias_gain` biases. Without a dtype: the network's
    // precision.
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

    Layer norm(const std::string& name, uint32_t channels);            // weight and bias, [1, channels] fp32
    Slot table(const std::string& name, uint32_t rows, uint32_t cols); // an embedding, fp32

    uint64_t parameters() const; // as in the file
    uint64_t device_bytes(const DeviceLimits& limits) const { return state_.planned_bytes(limits); }
    Status load(Device& device, const Checkpoint& checkpoint, std::span<const TensorSpec> schema,
                const LoadProgress& progress = {});

  private:
    // one tensor of the checkpoint and its way into a weight's rows
    struct Source {
        TensorSpec spec;
        std::function<void(std::span<const float> values, float* rows, uint32_t ld)> pack;
        std::optional<FrameShare> share = {}; // what the values are multiplied by
    };
    struct Entry {
        Slot weight;
        std::vector<Source> sources;
    };
    Entry& add(const std::string& name, uint32_t rows, uint32_t cols, DType dtype);
    void add_vector(Entry& entry, const std::string& name, uint32_t size, uint32_t first, uint32_t heads, bool geglu,
                    float gain);
    // kept from weight to weight: new memory costs more than what is written to it
    struct Scratch {
        std::vector<float> values, rows;
        std::vector<std::byte> bytes;
    };
    Status upload(Device& device, const Checkpoint& checkpoint, const Entry& entry, Scratch& scratch) const;
    Status read(const Checkpoint& checkpoint, const Source& source, std::vector<float>& values) const;

    DType precision_;
    DeviceLimits limits_;
    State state_;
    std::vector<Entry> entries_;
};

// rows of heads after padding each
constexpr uint32_t padded_heads(uint32_t rows, uint32_t heads)
{
    return heads * round_up(rows / heads, kRowPadding);
}

} // namespace semrover
