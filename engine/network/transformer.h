// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/transformer_weights.h"
#include "engine/network/token_sets.h"
#include "kernels/network.h"

#include <memory>

namespace semrover {

// what of a batch of sets does not change from step to step, in memory that outlives the graphs
struct TokenContext {
    Tensor labels, cells, sets, tiles, coords; // as in TokenSets
    Tensor pos;                                // [M, D]
    Tensor told;                               // [M, D]: what meets the labels' embeddings in place of pos, or none
    Tensor told_voxels;                        // [M, D]: what meets the embedded tokens in place of pos, or none
    Tensor mask;                               // [M, words]
    uint32_t longest = 0;
};

struct ToldTokens {
    Tensor semantic, voxels; // [M, D] each; voxels: none where the model tells semantic tokens alone
};

// The Σ-Voxfield transformer (docs/method.md §2): SD3's joint blocks over voxel and semantic tokens. Its functions add
// to a graph; D = heads * head_dim, C = 6 * points, M tokens of all sets.
class Transformer {
  public:
    // reads config.json and the weights of a voxfield_transformer folder, and its adapter if there is one
    static Result<std::unique_ptr<Transformer>> load(Device& device, const Path& folder, DType precision,
                                                     const LoadProgress& progress = {});
    // random weights of a config, for benchmarks
    static Result<std::unique_ptr<Transformer>> random(Device& device, const TransformerConfig& config,
                                                       DType precision);

    const TransformerConfig& config() const { return config_; }
    DType precision() const { return precision_; }
    const TransformerWeights& weights() const { return weights_; }
    uint32_t modulation_width() const { return modulation_width_; } // columns of the modulation table

    // sinusoid frequencies that the graphs read; part of the device memory of the model
    uint64_t device_bytes(const DeviceLimits& limits) const;

    // mask, pos, told and told_voxels of a context, from its other tensors; once per batch of sets
    [[nodiscard]] Tensor neighbors(Graph& g, const TokenContext& context,
                                   uint32_t near_row,         // from this row on cells see no others beyond
                                   double near_radius) const; // metres, if that is less than the attention radius
    [[nodiscard]] Tensor positions(Graph& g, const TokenContext& context) const;
    [[nodiscard]] ToldTokens tell(Graph& g,
                                  Tensor pos,              // [M, D]
                                  Tensor condition) const; // [M, W] in the model's precision; zeros tell nothing

    // adaLN modulations of every block for a list of timesteps; once per schedule
    void modulations(Graph& g,
                     Tensor timesteps,    // [T, 1] fp32 array
                     Tensor table) const; // [T, modulation_width] fp32

    // one evaluation
    [[nodiscard]] Tensor forward(Graph& g,
                                 Tensor tokens, // [M, C] in the model's precision
                                 const TokenContext& context,
                                 Tensor table,            // [T, modulation_width]
                                 Tensor table_row) const; // [2M] u32: row of the table for each token of both streams
                                                          // -> [M, C] fp32, predicted x0
  private:
    Transformer(const TransformerConfig& config, DType precision);
    Status upload_frequencies(Device& device);
    Tensor block(Graph& g, uint32_t index, Tensor x, const TokenContext& context, Tensor table, Tensor table_row) const;

    TransformerConfig config_;
    DType precision_;
    TransformerWeights weights_;
    std::vector<uint32_t> block_columns_; // first column of each block in the modulation table; last: norm_out
    uint32_t modulation_width_ = 0;
    State constants_;
    Slot position_frequencies_, time_frequencies_;
};

} // namespace semrover
