// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/network_blocks.h"

namespace semrover {

// diffusers' Transformer2DModel: self-attention, attention to a text, GEGLU, over the pixels of a feature map. Also its
// TransformerSpatioTemporalModel: each block is followed by one over the frames of a pixel, and mixed with it.
struct Transformer2d {
    struct Block {
        Layer norm1, norm2, norm3;
        Layer qkv, out;           // self-attention
        Layer query, context_out; // attention to the text; its keys and values are in a table, once per text
        uint32_t key_col = 0, value_col = 0;
        Layer ff_in, ff_out;
    };
    struct FrameBlock {
        Layer norm_in, entry_in, entry_out; // a GEGLU in front of the block
        Block block;
    };
    Layer norm, proj_in, proj_out;
    std::vector<Block> blocks;
    std::vector<FrameBlock> frame_blocks; // of a video: as many
    Layer frame_in, frame_out;            // of a video: embedding of a frame's number
    uint32_t frame_col = 0;               // its first column in the frame table
    DeviceTensor share;                   // of the frame blocks
    uint32_t channels = 0, heads = 0, groups = 0;

    uint32_t head_dim() const { return round_up(channels / heads, kRowPadding); } // as stored
};

struct Transformer2dShape {
    uint32_t channels, heads, blocks, groups;
    bool linear_projection; // proj_in and proj_out are matrices in the file, else 1x1 convolutions
    bool video = false;
};

// adds the keys and values that the text needs to `context`, which becomes one matrix, and its rows to `columns`
Transformer2d declare_transformer_2d(NetworkWeights& weights, const std::string& name, const Transformer2dShape& shape,
                                     std::vector<NetworkWeights::Part>& context, uint32_t& columns);

struct TextContext {
    Tensor table;            // [rows, columns] keys and values of every attention
    uint32_t tokens = 0;     // of an image
    uint32_t token_rows = 0; // rows from one image's (or video's) tokens to the next; 0: all have the same
};
[[nodiscard]] FeatureMap transformer_2d(Graph& g, const NetworkWeights& weights, const Transformer2d& t, NormInput x,
                                        const TextContext& context);

// the frames of videos; the same text for all frames of a video
struct FrameEmbedding {
    uint32_t frames = 1; // of a video
    Tensor table;        // [frames, columns] fp32: embeddings of their numbers, for every transformer
    Tensor table_row;    // [images] u32: number of each image in its video
};
[[nodiscard]] FeatureMap video_transformer(Graph& g, const NetworkWeights& weights, const Transformer2d& t, NormInput x,
                                           const TextContext& context, const FrameEmbedding& frames);

// embeds the frames' numbers, [frames, channels], in columns of the frame table
void embed_frames(Graph& g, const Transformer2d& t, Tensor numbers, // [frames, 1] fp32 array
                  Tensor frequencies,                               // [channels / 2] fp32
                  Tensor table);                                    // [frames, columns] fp32

} // namespace semrover
