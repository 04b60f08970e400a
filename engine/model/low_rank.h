// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"

#include <map>

namespace semrover {

constexpr const char* kAdapterFile = "pytorch_lora_weights.safetensors"; // as diffusers calls it

// The file that a preset of model_index.json names, the usual one where it names none. bad_input: no name of a file
Result<std::string> preset_adapter(const Json& preset);

// A low-rank adapter (LoRA, Hu et al. 2021, arXiv 2106.09685): what is added to some of a network's matrices. For
// NAME.weight [N, K] the file has NAME.lora_A.weight [r, K] and NAME.lora_B.weight [N, r]; B A is added. The rank r may
// differ from matrix to matrix.
class LowRankAdapter {
  public:
    // empty where there is no such file. bad_input: a file that is damaged
    static Result<LowRankAdapter> open(const Path& path);

    // bad_input: one line lists tensors that are no such pair, and what belongs to no matrix of the schema or does not
    // fit it
    Status require(std::span<const TensorSpec> schema) const;
    bool has(const std::string& name) const { return pairs_.contains(name); }
    // adds to all of a matrix that it has. Call after require()
    void add(const std::string& name, std::span<float> values) const;

  private:
    struct Pair {
        uint32_t rank = 0;
        std::vector<float> down, up; // A, B
    };
    Path path_;
    std::map<std::string, Pair> pairs_; // by the matrix's name
};

} // namespace semrover
