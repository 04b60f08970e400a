// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/network_blocks.h"

namespace semrover {

// diffusers' Transformer2DModel: self-attention, attention to a text, GEGLU, over the pixels of a feature map
struct Transformer2d {
    struct Block {
        Layer norm1, norm2, norm3;
        Layer qkv, out;           // self-attention
        Layer query, context_out; // attention to the text; its keys and values are in a table, once per text
        uint32_t key_col = 0, value_col = 0;
        Layer ff_in, ff_out;
    };
    Layer norm, proj_in, proj_out;
    std::vector<Block> blocks;
    uint32_t channels = 0, heads = 0, groups = 0;

    uint32_t head_dim() const { return round_up(channels / heads, kRowPadding); } // as stored
};

struct Transformer2dShape {
    uint32_t channels, heads, blocks, groups;
    bool linear_projection; // proj_in and proj_out are matrices in the file, else 1x1 convolutions
};

// adds the keys and values that the text needs to `context`, which becomes one matrix, and its rows to `columns`
Transformer2d declare_transformer_2d(NetworkWeights& weights, const std::string& name, const Transformer2dShape& shape,
                                     std::vector<NetworkWeights::Part>& context, uint32_t& columns);

struct TextContext {
    Tensor table;            // [rows, columns] keys and values of every attention
    uint32_t tokens = 0;     // of an image
    uint32_t token_rows = 0; // rows from one image's tokens to the next; 0: all images have the same
};
[[nodiscard]] FeatureMap transformer_2d(Graph& g, const NetworkWeights& weights, const Transformer2d& t, NormInput x,
                                        const TextContext& context);

} // namespace semrover
