// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale + mask) v over both streams of a set: qkv [2M, 3 * heads * head_dim] -> [streams * M, heads *
// head_dim]
#include "kernels/network.h"

#include "attention.spv.h"
#include "kernels/network/matmul_tiles.h"
#include "shaders/network/attention.h"

#include <cmath>

namespace semrover {

namespace {

constexpr uint32_t kMostMatrixDim = 128; // attention.coopmat keeps queries and sums in registers

} // namespace

Tensor attention(Graph& g, Tensor qkv, Tensor tiles, Tensor mask, uint32_t heads, uint32_t streams)
{
    const uint32_t head_dim = qkv.cols / (3 * heads), rows = qkv.rows / 2;
    SR_ASSERT(head_dim % 8 == 0 && qkv.cols == 3 * heads * head_dim, "attention: {} columns for {} heads", qkv.cols,
              heads);
    SR_ASSERT(mask.rows == rows, "attention: mask of {} rows for {} tokens", mask.rows, rows);
    const Tensor y = g.matrix(streams * rows, heads * head_dim, qkv.dtype, "attention");
    AttentionPush push{};
    push.rows = rows;
    push.qkv_ld = qkv.ld;
    push.y_ld = y.ld;
    push.heads = heads;
    push.head_dim = head_dim;
    push.words = mask.cols;
    push.scale = 1.f / std::sqrt(float(head_dim));
    DispatchOptions options;
    options.constants = group_constants(g.limits(), {{"kChunks", head_dim / 8}});
    const uint32_t excluded = head_dim > kMostMatrixDim ? kFeatureCooperativeMatrix : 0u;
    options.variant = &g.variant(kernel::attention, options.constants, std::vector{qkv}, excluded);
    options.flops =
        4.0 * streams * rows * (64.0 * mask.cols) * heads * head_dim; // an upper bound: masked blocks are skipped
    g.dispatch(kernel::attention, {{"Qkv", qkv}, {"Tiles", tiles}, {"Mask", mask}, {"Y", y}}, push,
               groups(tiles.rows, heads, streams), std::move(options));
    return y;
}

} // namespace semrover
