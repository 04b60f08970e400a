// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v, per image and head: q [batch * query_rows, ..], k and v in kv [batch * key_rows, ..] ->
// [batch * query_rows, heads * head_dim]
#include "kernels/network.h"

#include "flash_attention.spv.h"
#include "kernels/network/matmul_tiles.h"

#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr uint32_t kMostFlashMatrixDim = 160; // flash_attention.coopmat keeps queries and sums in registers

void check(const Tensor& q, const Tensor& kv, const FlashAttentionOptions& o)
{
    const uint32_t width = o.heads * o.head_dim;
    SR_ASSERT(o.heads > 0 && o.head_dim > 0 && o.head_dim % 8 == 0 && o.head_dim <= 512,
              "flash_attention: {} heads of {}", o.heads, o.head_dim);
    SR_ASSERT(o.queries > 0 && o.queries <= o.query_rows && q.rows == o.batch * o.query_rows,
              "flash_attention: {} images of {} queries in {} rows, of {}", o.batch, o.queries, o.query_rows, q.rows);
    SR_ASSERT(o.keys > 0 && (o.key_rows == 0 || o.keys <= o.key_rows) &&
                  kv.rows >= (o.key_rows ? o.batch * o.key_rows : o.keys),
              "flash_attention: {} images of {} keys in {} rows, of {}", o.batch, o.keys, o.key_rows, kv.rows);
    SR_ASSERT(o.q_col % 8 == 0 && o.k_col % 8 == 0 && o.v_col % 8 == 0 && o.q_col + width <= q.cols &&
                  o.k_col + width <= kv.cols && o.v_col + width <= kv.cols,
              "flash_attention: {} columns from {} of {}, {} and {} of {}", width, o.q_col, q.cols, o.k_col, o.v_col,
              kv.cols);
}

} // namespace

Tensor flash_attention(Graph& g, Tensor q, Tensor kv, const FlashAttentionOptions& o)
{
    check(q, kv, o);
    const uint32_t chunks = o.head_dim / 8;
    const Tensor y = g.matrix(q.rows, o.heads * o.head_dim, q.dtype, "flash_attention");
    FlashAttentionPush push{};
    push.rows = push.query_rows = o.query_rows;
    push.queries = o.queries;
    push.keys = o.keys;
    push.key_rows = o.key_rows;
    push.q_ld = q.ld;
    push.kv_ld = kv.ld;
    push.y_ld = y.ld;
    push.q_col = o.q_col;
    push.k_col = o.k_col;
    push.v_col = o.v_col;
    push.chunks = chunks;
    push.scale = float(std::numbers::log2e * (o.scale > 0 ? o.scale : 1 / std::sqrt(double(o.head_dim))));
    DispatchOptions dispatch;
    dispatch.flops = 4.0 * o.batch * o.query_rows * o.keys * o.heads * o.head_dim;
    const uint32_t lane_queries = is_little(dispatch.flops) ? 4 : 8;
    dispatch.constants = group_constants(
        g.limits(), {{"kChunks", chunks}, {"kMostChunks", chunks <= 20 ? 20u : 64u}, {"kQueries", lane_queries}});
    const uint32_t excluded = o.head_dim > kMostFlashMatrixDim ? kFeatureCooperativeMatrix : 0u;
    dispatch.variant = &g.variant(kernel::flash_attention, dispatch.constants, std::vector{q, kv}, excluded);
    const KernelVariant& variant = *dispatch.variant;
    const Tile tile = variant.name == "cpu" ? Tile{lane_queries * variant.local_size[0], 1} : fixed_tile(variant);
    if (o.batch == 1)
        dispatch.banded = {"Q", "Y"};
    g.dispatch(kernel::flash_attention, {{"Q", q}, {"Kv", kv}, {"Y", y}}, push,
               tiles(o.query_rows, o.heads, o.batch, tile), std::move(dispatch));
    return y;
}

} // namespace semrover
