// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

#include <array>

// The ops of networks, in pipeline order. Ops are functions on lazy values: they add dispatches to the graph and return
// what will be computed. Matrices are row-major with rows padded to kRowPadding elements; the padding is always zero.
// Storage is fp32 or fp16, arithmetic and statistics fp32.
namespace semrover {

struct MatmulTile; // kernels/network/matmul_tiles.h

// Where an op writes that joins tensors: rows or columns of a larger matrix, in place of a new one. A whole output that
// outlives the graph is kept with Graph::keep.
struct PartOf {
    Tensor whole;              // none: a new tensor
    uint32_t row = 0, col = 0; // where the part begins; col a multiple of 8

    bool valid() const { return whole.valid(); }
    Tensor of(uint32_t rows, uint32_t cols) const { return whole.row_range(row, rows).col_range(col, cols); }
};

// -- dense layers ----------------------------------------------------------------------------------------------------

// y = x w^T + bias, per group: rows [i * M, (i + 1) * M) of x meet rows [i * N, (i + 1) * N) of w
struct GemmOptions {
    uint32_t groups = 1;
    DType dtype = DType::f16; // of y
    PartOf part = {};
    const MatmulTile* tile = nullptr; // in place of those that suit: for experiments
};
[[nodiscard]] Tensor gemm(Graph& g,
                          Tensor x,    // [groups * M, K] fp32 or fp16
                          Tensor w,    // [groups * N, K], as x
                          Tensor bias, // [groups, N] fp32, or none
                          const GemmOptions& options = {});

// y = f(x): [M, N] -> [M, N]; each runs in the epilogue of the gemm or convolution that makes x
[[nodiscard]] Tensor gelu(Graph& g, Tensor x);            // 0.5 x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3)))
[[nodiscard]] Tensor silu(Graph& g, Tensor x);            // x / (1 + exp(-x))
Tensor relu(Graph& g, Tensor x, const PartOf& part = {}); // max(x, 0); of a part, zeros fill the last 8 columns

// rows of a table that modulate tokens: one row per timestep, chosen per token row
struct Modulation {
    Tensor table;      // [timesteps, width] fp32
    Tensor table_row;  // [rows] u32
    uint32_t col = 0;  // first column, for group 0
    uint32_t step = 0; // columns from one group's to the next
};

// y = residual + gate * x; runs in the epilogue of the gemm that makes x
[[nodiscard]] Tensor gated_add(Graph& g,
                               Tensor x,        // [groups * M, N]
                               Modulation gate, // N columns
                               Tensor residual, // [groups * M, N]
                               uint32_t groups = 1);

// y = residual + x; runs in the epilogue of the gemm that makes x
Tensor add(Graph& g,
           Tensor x,        // [M, N]
           Tensor residual, // [M, N]
           const PartOf& part = {});

// y = LayerNorm(x) * (1 + scale) + shift, no affine part
[[nodiscard]] Tensor modulate(Graph& g,
                              Tensor x,         // [groups * M, N]
                              Modulation shift, // N columns, and as many from scale_col on
                              uint32_t scale_col, float eps, uint32_t groups = 1);

// -- embeddings ------------------------------------------------------------------------------------------------------

// y = table[index] (+ x)
Tensor embedding(Graph& g,
                 Tensor index, // [M] u32; clamped to the table
                 Tensor table, // [classes, N]
                 Tensor x,     // [M, N], or none
                 DType dtype,  // of y
                 const PartOf& part = {});

// y = per axis [sin(x w_0), .., cos(x w_0), ..], or cosines first
[[nodiscard]] Tensor sinusoid(Graph& g,
                              Tensor x,           // [M, A] fp32 array
                              Tensor frequencies, // [F] fp32
                              bool cos_first,
                              DType dtype); // y: [M, A * 2F]

// -- masked joint attention ------------------------------------------------------------------------------------------

// Tokens of several sets, packed one after the other without padding; the semantic stream repeats the voxel stream's
// order. A query sees the tokens of both streams in the voxels of its own set that lie within the radius.
constexpr uint32_t kAttentionTile = 32; // queries of a tile, at most; a tile stays within one set and may be empty

// squared, in voxels; from a row on, if need be, another
struct NeighborRadius {
    int32_t radius2 = 0;
    uint32_t near_row = ~0u;
    int32_t near_radius2 = 0;
};

// bit j of row i: voxel j of the set of i has di^2 + dj^2 + dk^2 <= radius2
[[nodiscard]] Tensor neighbor_mask(Graph& g,
                                   Tensor cells, // [M, 4] i32 array: i, j, k, unused
                                   Tensor sets,  // [M, 2] u32 array: first row and number of rows of the row's set
                                   uint32_t longest_set,
                                   const NeighborRadius& radius); // y: [M, words] u32 array, words = longest_set / 32,
                                                                  // rounded up

// per head of q and k: y = x / sqrt(mean(x^2) + eps) * weight
[[nodiscard]] Tensor head_rms_norm(Graph& g,
                                   Tensor qkv,     // [groups * M, 3 * heads * head_dim]
                                   Tensor weights, // [2 * groups, head_dim] fp32: q and k of each group
                                   uint32_t heads, float eps, uint32_t groups);

// y = softmax(q k^T / sqrt(head_dim) + mask) v
[[nodiscard]] Tensor attention(Graph& g,
                               Tensor qkv,   // [2M, 3 * heads * head_dim]: voxel stream, semantic stream; q, k, v
                               Tensor tiles, // [T, 4] u32 array: first row, rows, first row and rows of the set
                               Tensor mask,  // [M, words] u32 array
                               uint32_t heads,
                               uint32_t streams); // whose queries are answered: 1 voxel only, 2 both

// -- images: convolution, norms, attention ---------------------------------------------------------------------------

// Images as NHWC matrices: pixel (y, x) of image b is row b * image_rows() + y * width + x. The rows of an image are
// padded, so that no tile of a kernel holds two images; padding rows hold finite numbers that nothing depends on.
constexpr uint32_t kImageRowPadding = 16;
struct FeatureMap {
    Tensor data; // [batch * image_rows(), channels]
    uint32_t batch = 1, height = 0, width = 0;

    bool valid() const { return data.valid(); }
    uint32_t channels() const { return data.cols; }
    uint32_t pixels() const { return height * width; }
    uint32_t image_rows() const { return round_up(height * width, kImageRowPadding); }
    FeatureMap with(Tensor other) const { return {other, batch, height, width}; } // the same images, other channels
};
[[nodiscard]] FeatureMap feature_map(Graph& g, uint32_t batch, uint32_t height, uint32_t width, uint32_t channels,
                                     DType dtype, std::string_view name = "");

// y[n] = bias[n] + sum over taps and channels of w[n, tap, c] x[c] at the tap's pixel, zeros outside the image. Runs as
// an implicit GEMM. Two inputs are read as if concatenated along channels.
struct ConvOptions {
    uint32_t kernel = 3; // square; 1 has no padding, others as below
    uint32_t stride = 1;
    bool end_padding = false; // zeros to the right and below only, (0, 1, 0, 1), instead of all around
    uint32_t upsampled_height = 0, upsampled_width = 0; // nearest x2 before the convolution, to 2n or 2n - 1; 0: none
    DType dtype = DType::f16;                           // of y
    struct Taps {
        uint32_t height = 0, width = 0;
        uint32_t padding_y = 0, padding_x = 0; // on both sides
    } taps = {};                               // any rectangle instead of `kernel` and its padding
    const MatmulTile* tile = nullptr;          // in place of those that suit: for experiments
    uint32_t slices = 0; // of K, of a variant that has them, in place of as many as suit: for experiments
};
[[nodiscard]] FeatureMap
conv2d(Graph& g, FeatureMap x,
       FeatureMap x2, // channels after those of x, or none
       Tensor w,      // [N, taps * (C + C2)], row by row of taps, each of C and C2 padded to kRowPadding
       Tensor bias,   // [1, N] fp32, or none
       const ConvOptions& options = {});

// y = sum over slices of K + bias: what workgroups of conv2d summed apart, where it cuts K; epilogues of a convolution
// run in that of this one
void split_k_reduce(Graph& g,
                    Tensor sums, // [batch * image_rows, slices * ld of y] fp32, a row's slices one after the other
                    uint32_t slices,
                    Tensor bias, // [1, N] fp32, or none
                    const FeatureMap& y);

// y = x + table[table_row[image]][col + channel]; runs in the epilogue of the convolution that makes x
struct ChannelShift {
    Tensor table;     // [T, width] fp32
    Tensor table_row; // [batch] u32
    uint32_t col = 0; // a multiple of 4
};
[[nodiscard]] FeatureMap channel_shift(Graph& g, FeatureMap x, const ChannelShift& shift);

// y = winograd(x) + bias + shift + residual: 3x3 taps at stride 1 with a quarter of the multiplications, in fp32:
// F(4x4, 3x3). Takes 4 floats per weight of device memory, and 64 MiB for tiles.
struct ConvAddends {
    ChannelShift shift;  // or none
    FeatureMap residual; // or none
};
[[nodiscard]] Tensor winograd_weight(Graph& g, Tensor w); // [N, 9 * C], as conv2d's -> [36 * N, C] fp32
[[nodiscard]] FeatureMap winograd_conv2d(Graph& g, FeatureMap x,
                                         Tensor u,    // winograd_weight()
                                         Tensor bias, // [1, N] fp32, or none
                                         const ConvOptions& options = {}, const ConvAddends& addends = {});
// the same by Winograd's algorithm or by conv2d, channel_shift and add, as the device prefers
[[nodiscard]] FeatureMap convolution(Graph& g, FeatureMap x, Tensor w, Tensor bias, const ConvOptions& options = {},
                                     const ConvAddends& addends = {});
// True where winograd_conv2d fits the device's limits and is expected to be faster than conv2d, although it transforms
// the weights in every run: on CPUs, as measured on lavapipe. GPUs have more multiplications for a byte and use conv2d.
[[nodiscard]] bool prefers_winograd(const DeviceLimits& limits, const FeatureMap& x, uint32_t outputs,
                                    const ConvOptions& options);

// mean and sum of squared differences from it, of every channel over every 16 rows; taken by the pass that makes x
[[nodiscard]] Tensor channel_moments(Graph& g, FeatureMap x); // [batch * image_rows / 16, 2 * C] fp32: mean, m2 pairs

// y = GroupNorm(x, x2) * weight + bias, then SiLU if asked; groups may span both inputs
struct GroupNormOptions {
    uint32_t groups = 32;
    uint32_t images = 1; // that have their statistics together: the frames of a video
    float eps = 1e-5f;
    bool silu = false;
    DType dtype = DType::f16; // of y
};
struct NormInput {
    FeatureMap x;
    Tensor moments; // channel_moments() of x
};
[[nodiscard]] FeatureMap group_norm(Graph& g, NormInput x,
                                    NormInput x2,  // channels after those of x, or none
                                    Tensor weight, // [1, C + C2] fp32
                                    Tensor bias,   // [1, C + C2] fp32
                                    const GroupNormOptions& options = {});

// y = LayerNorm(x) * weight + bias
[[nodiscard]] Tensor layer_norm(Graph& g,
                                Tensor x,      // [M, N]
                                Tensor weight, // [1, N] fp32
                                Tensor bias,   // [1, N] fp32
                                float eps);

// y = h * gelu(gate), with the exact erf; h and gate alternate in blocks of eight columns: x = [h 0..7, gate 0..7,
// h 8..15, ..]. Runs in the epilogue of the gemm that makes x.
[[nodiscard]] Tensor geglu(Graph& g, Tensor x); // [M, 2N] -> [M, N], N a multiple of 8

// y = softmax(q k^T scale) v, per image and head; thousands of queries and keys, nothing of their product is stored
struct FlashAttentionOptions {
    uint32_t heads = 1, head_dim = 0;         // head_dim a multiple of 8, as stored
    float scale = 0;                          // of the scores; 0: 1 / sqrt(head_dim)
    uint32_t batch = 1;                       // images
    uint32_t queries = 0, query_rows = 0;     // of an image; rows from one image's queries to the next
    uint32_t keys = 0, key_rows = 0;          // of an image, likewise; key_rows = 0: every image has the same keys
    uint32_t q_col = 0, k_col = 0, v_col = 0; // first columns, multiples of 8
};
[[nodiscard]] Tensor flash_attention(Graph& g,
                                     Tensor q,  // [batch * query_rows, q_col + heads * head_dim or more]
                                     Tensor kv, // [(batch *) key_rows, ..] with keys and values; may be q itself
                                     const FlashAttentionOptions& options); // [batch * query_rows, heads * head_dim]

// y = softmax(q k^T scale) v of the pixels of each image, one head as wide as q, with q, k and v = x w^T + bias: flash
// attention, or products, as the device prefers
[[nodiscard]] FeatureMap image_attention(Graph& g, FeatureMap x,
                                         Tensor weight, // [3 * dim, C]: of q, k and v
                                         Tensor bias,   // [1, 3 * dim] fp32
                                         float scale);  // -> [.., dim]

// y = softmax(scale x) over the first columns of each row; zeros behind them
struct SoftmaxOptions {
    uint32_t count = 0; // columns
    float scale = 1;
    DType dtype = DType::f16; // of y
};
[[nodiscard]] Tensor softmax(Graph& g, Tensor x, const SoftmaxOptions& options); // [M, N] -> [M, N]

// -- videos ----------------------------------------------------------------------------------------------------------

// The frames of a video are images one after the other, videos likewise.
constexpr uint32_t kMostFrames = 64;

// The same rows as one image a video, of which each row is a frame, padding included: a convolution with taps {3, 1}
// then reaches from a pixel to the same pixel of the frames around.
// note: padding rows are pixels there, so statistics must be taken of the images
[[nodiscard]] FeatureMap frames_as_rows(const FeatureMap& x, uint32_t frames);

// y = softmax(q k^T scale) v over the frames of a video, per pixel and head
struct FrameAttentionOptions {
    uint32_t heads = 1, head_dim = 0; // head_dim a multiple of 8, as stored
    float scale = 0;                  // of the scores; 0: 1 / sqrt(head_dim)
    uint32_t videos = 1, frames = 1;  // frames of a video, kMostFrames at most
    uint32_t image_rows = 0;          // from one frame to the next
};
[[nodiscard]] Tensor frame_attention(Graph& g,
                                     Tensor qkv, // [videos * frames * image_rows, 3 * heads * head_dim]: q, k, v
                                     const FrameAttentionOptions& options); // [.., heads * head_dim]

// y = x + share (z - x)
[[nodiscard]] Tensor blend(Graph& g,
                           Tensor x,      // [M, N]
                           Tensor z,      // [M, N]
                           Tensor share); // [1, 1] fp32

} // namespace semrover
