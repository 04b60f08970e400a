// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/transformer_weights.h"
#include "kernels/network.h"

#include <array>
#include <memory>
#include <span>

namespace semrover {

using CellIndex = std::array<int32_t, 3>;

// rows of a stream come in multiples of this, so that the semantic stream starts at an aligned byte
constexpr uint32_t kRowAlignment = 16;

// Local sets packed one after the other, without padding, as the kernels read them (kernels/network.h, masked joint
// attention).
struct TokenSets {
    std::vector<uint32_t> labels; // [M]; num_classes is the null label
    std::vector<int32_t> cells;   // [M, 4]: i, j, k, 0
    std::vector<uint32_t> sets;   // [M, 2]: first row and number of rows of the row's set
    std::vector<uint32_t> tiles;  // [T, 4]: first row, rows, first row and rows of the set
    std::vector<float> coords;    // [M, 3]: cell index relative to the mean of the set, in voxels
    uint32_t longest = 0;         // rows of the largest set

    uint32_t rows() const { return uint32_t(labels.size()); }
    void add(std::span<const CellIndex> set_cells, std::span<const uint32_t> set_labels);
    // A set that nobody reads up to a multiple of kRowAlignment rows. One tile in any case, if need be of no rows: so
    // smaller sets have no more rows or tiles than larger ones.
    void pad(uint32_t null_label);
};

// what of a batch of sets does not change from step to step, in memory that outlives the graphs
struct TokenContext {
    Tensor labels, cells, sets, tiles, coords; // as in TokenSets
    Tensor pos;                                // [M, D]
    Tensor conditioning;                       // [M, D]: added to the labels' embeddings in place of pos, or none
    Tensor voxel_conditioning;                 // [M, D]: added to the embedded tokens in place of pos, or none
    Tensor mask;                               // [M, words]
    uint32_t longest = 0;
};

// conditioning and voxel_conditioning of a context; voxels: none where the model conditions semantic tokens alone
struct Conditioned {
    Tensor semantic, voxels; // [M, D] each
};

// The Σ-Voxfield transformer (docs/method.md §2): SD3's joint blocks over voxel and semantic tokens. Its functions add
// to a graph; D = heads * head_dim, C = 6 * points, M tokens of all sets.
class Transformer {
  public:
    // reads config.json and the weights of a voxfield_transformer folder, and an adapter: the one that is named, or the
    // folder's own if there is one
    static Result<std::unique_ptr<Transformer>> load(Device& device, const Path& folder, DType precision,
                                                     const Path& adapter = {}, const LoadProgress& progress = {});
    // random weights of a config, for benchmarks
    static Result<std::unique_ptr<Transformer>> random(Device& device, const TransformerConfig& config,
                                                       DType precision);

    const TransformerConfig& config() const { return config_; }
    DType precision() const { return precision_; }
    const TransformerWeights& weights() const { return weights_; }
    uint32_t modulation_width() const { return modulation_width_; } // columns of the modulation table

    // sinusoid frequencies that the graphs read; part of the device memory of the model
    uint64_t device_bytes(const DeviceLimits& limits) const;

    // mask, pos and the conditionings of a context, from its other tensors; once per batch of sets
    [[nodiscard]] Tensor neighbors(Graph& g, const TokenContext& context,
                                   uint32_t near_row,         // from this row on voxels see no others beyond
                                   double near_radius) const; // metres, if that is less than the attention radius
    [[nodiscard]] Tensor positions(Graph& g, const TokenContext& context) const;
    [[nodiscard]] Conditioned condition(Graph& g,
                                        Tensor pos,              // [M, D]
                                        Tensor condition) const; // [M, W] in the model's precision; 0: unconditioned

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
    TensorPool constants_;
    DeviceTensor position_frequencies_, time_frequencies_;
};

} // namespace semrover
