// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/load_progress.h"
#include "runtime/base/safetensors.h"
#include "runtime/device/device.h"
#include "runtime/device/tensor_pool.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

// How weights come from files to device memory: a layout is data, and one loop packs them all.
namespace semrover {

// consecutive rows or columns of a file's tensor, and where they go
struct IndexRange {
    uint32_t from, to, count;
};
using IndexRanges = std::vector<IndexRange>;

IndexRanges straight(uint32_t count, uint32_t to = 0);
// `count` of so many heads, each padded to kRowPadding
IndexRanges of_heads(uint32_t count, uint32_t heads, uint32_t to = 0);
// GEGLU: values, then gates, as many of each, interleaved in blocks of eight
IndexRanges interleaved(uint32_t count, uint32_t to = 0);

// The share of what a video's frames make together, against what each makes alone: sigmoid(mix) or, as diffusers'
// AlphaBlender has it unless it is switched, 1 - sigmoid(mix)
struct FrameShare {
    std::string mix_factor; // the tensor's name, [1]
    bool switched = false;
};

// One tensor of a file, as [rows, cols, taps], and where it goes: row r, column c of tap t to
// rows(r), t * tap_width + cols(c) of the weight, multiplied by gain. What nothing goes to is zero.
struct WeightPart {
    TensorSpec spec; // of no name: ones, for what is nothing but a share
    uint32_t cols_of_row = 0;
    IndexRanges rows, cols;
    uint32_t taps = 1, tap_width = 0;
    float gain = 1;
    std::optional<FrameShare> share = {}; // multiplies, too
};
struct WeightLayout {
    DeviceTensor weight;
    std::vector<WeightPart> parts;
};

struct TensorValues {
    std::span<const std::byte> bytes; // all of the tensor
    DType dtype = DType::f32;         // f32, f16 or bf16; of a weight in blocks also i8, with scales (weight_blocks.h)
    Path file = {};                   // for errors: where they are, if in a file,
    std::string name = {};            // under which name
};
// a tensor's values, in its file or computed into `scratch`
using TensorSource = std::function<Result<TensorValues>(const TensorSpec& spec, std::vector<float>& scratch)>;

// Packs and uploads weights whose memory is allocated. Host memory: a window of some MiB, and what the source computes.
// Equal types and rows as they lie are one copy; everything else is one pass over a row at a time. Weights of type q8_0
// take their blocks from the file, whose scales a gain multiplies, or make them of numbers. Errors: bad_input
// where a number is none, or is one that the weight's type cannot hold; those of the source, the device and `progress`
Status load_weights(Device& device, std::span<const WeightLayout> weights, const TensorSource& source,
                    const LoadProgress& progress = {});

std::vector<TensorSpec> schema_of(std::span<const WeightLayout> weights); // each tensor once, by name
uint64_t parameters_of(std::span<const WeightLayout> weights);            // as in the file

} // namespace semrover
