// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/low_rank.h"
#include "engine/model/transformer_config.h"
#include "engine/model/weight_loader.h"

namespace semrover {

// one joint block; streams (voxel, semantic) stacked as groups, but where the last block has only the voxel stream
struct BlockWeights {
    DeviceTensor qkv, qkv_bias;       // [2 * 3D, D], [2, 3D]
    DeviceTensor out, out_bias;       // [streams * D, D]
    DeviceTensor ff_in, ff_in_bias;   // [streams * 4D, D]
    DeviceTensor ff_out, ff_out_bias; // [streams * D, 4D]
    DeviceTensor modulation,
        modulation_bias;     // [12D, D]; last block [8D, D]. Per stream: shift, scale, gate of attention, of the mlp
    DeviceTensor head_norms; // [4, head_dim]: q, k, added q, added k; only with qk_norm
};

// The transformer's parameters in device memory, in the packed layout that its kernels read.
class TransformerWeights {
  public:
    // lays out the weights of a config, without loading anything
    TransformerWeights(const TransformerConfig& config, DType precision);

    uint64_t device_bytes(const DeviceLimits& limits) const { return state_.planned_bytes(limits); }
    uint64_t parameters() const { return parameters_of(weights_); }

    // checks every name and shape, then uploads, with what the adapter adds. Errors: bad_input, out_of_memory
    Status load(Device& device, const SafetensorsSet& file, const LowRankAdapter& adapter,
                const LoadProgress& progress = {});
    // seeded values at the scale of a trained model, for benchmarks
    Status randomize(Device& device, uint64_t seed);

    DeviceTensor proj_in, proj_in_bias, pos_embed, pos_embed_bias, semantic_embed;
    DeviceTensor condition_in, condition_out; // [D, W], [D, D]; none without a condition
    DeviceTensor condition_voxels;            // [D, D]; none where semantic tokens alone are conditioned
    DeviceTensor time_in, time_in_bias, time_out, time_out_bias; // fp32: their input reaches 1000 radians
    DeviceTensor norm_out, norm_out_bias;                        // [2D, D]: shift, scale
    DeviceTensor proj_out, proj_out_bias;
    std::vector<BlockWeights> blocks;
    uint32_t streams(size_t block) const { return block + 1 < blocks.size() ? 2 : 1; }

  private:
    DeviceTensor add(uint32_t rows, uint32_t cols, DType dtype, std::string_view name);
    DType type_of(const std::string& weight, uint32_t cols) const;
    std::vector<TensorSpec> schema() const; // of the file
    void put(const DeviceTensor& slot, WeightPart part);
    void place(const std::string& name, const DeviceTensor& weight);
    void place(const std::string& name, const DeviceTensor& weight, const DeviceTensor& bias, uint32_t row,
               uint32_t rows, uint32_t bias_row = 0, uint32_t bias_col = 0);
    void place_swapped(const std::string& name, const DeviceTensor& weight, const DeviceTensor& bias, uint32_t row,
                       uint32_t rows);
    void add_block(uint32_t index, bool last);
    void add_stream(const std::string& block, const BlockWeights& b, uint32_t stream, bool last);

    TransformerConfig config_;
    DType precision_;
    TensorPool state_;
    std::vector<WeightLayout> weights_; // in the order of their declaration
};

} // namespace semrover
