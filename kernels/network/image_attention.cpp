// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v of the pixels of each image, one wide head, q, k and v = x w^T + bias: flash attention, or
// products where matrix units make them. The only place that chooses
#include "kernels/network.h"

#include "gemm.spv.h"

namespace semrover {

namespace {

// Matrix units are made for them. q, k and v are parts of one matrix, which begin where the device can bind.
bool prefers_products(Graph& g, const FeatureMap& x)
{
    const DType half = DType::f16;
    const Tensor like_x{.dtype = half};
    const KernelVariant& gemm = g.variant(kernel::gemm, {}, std::vector{like_x, like_x});
    return x.data.dtype == half && (gemm.features & kFeatureCooperativeMatrix) &&
           x.channels() * dtype_bytes(half) % g.limits().offset_alignment == 0;
}

// Values are made transposed, as the second GEMM wants them; their bias is added behind it, since the weights of a
// query add up to 1.
Tensor by_products(Graph& g, const FeatureMap& x, Tensor weight, Tensor bias, float scale)
{
    constexpr uint32_t kMostScores = 1u << 22; // at a time, each in fp32
    const uint32_t dim = weight.rows / 3, rows = x.image_rows();
    const uint32_t piece = std::max(round_up(kMostScores / rows, kImageRowPadding), kImageRowPadding);
    const DType dtype = x.data.dtype;
    const Tensor qk = gemm(g, x.data, weight.row_range(0, 2 * dim), bias.col_range(0, 2 * dim), {.dtype = dtype});
    const Tensor y = g.matrix(x.data.rows, dim, dtype, "image_attention");
    for (uint32_t image = 0; image < x.batch; ++image) {
        const Tensor keys = qk.col_range(dim, dim).row_range(image * rows, rows);
        const Tensor values = gemm(g, weight.row_range(2 * dim, dim), x.data.row_range(image * rows, rows), {},
                                   {.dtype = dtype}); // [dim, rows]
        for (uint32_t first = 0; first < rows; first += piece) {
            const uint32_t at = image * rows + first, count = std::min(piece, rows - first);
            const Tensor q = qk.col_range(0, dim).row_range(at, count);
            const Tensor scores = gemm(g, q, keys, {}, {.dtype = DType::f32});
            (void)gemm(g, softmax(g, scores, {x.pixels(), scale, dtype}), values, bias.col_range(2 * dim, dim),
                       {.dtype = dtype, .part = {.whole = y, .row = at}});
        }
    }
    return y;
}

Tensor by_blocks(Graph& g, const FeatureMap& x, Tensor weight, Tensor bias, float scale)
{
    const Tensor qkv = gemm(g, x.data, weight, bias, {.dtype = x.data.dtype});
    FlashAttentionOptions o;
    o.head_dim = qkv.cols / 3;
    o.scale = scale;
    o.batch = x.batch;
    o.queries = o.keys = x.pixels();
    o.query_rows = o.key_rows = x.image_rows();
    o.k_col = o.head_dim;
    o.v_col = 2 * o.head_dim;
    return flash_attention(g, qkv, qkv, o);
}

} // namespace

FeatureMap image_attention(Graph& g, FeatureMap x, Tensor weight, Tensor bias, float scale)
{
    SR_ASSERT(weight.rows % 3 == 0 && weight.cols == x.channels() && bias.cols == weight.rows,
              "image_attention: weight [{}, {}], bias of {} for {} channels", weight.rows, weight.cols, bias.cols,
              x.channels());
    return x.with(prefers_products(g, x) ? by_products(g, x, weight, bias, scale)
                                         : by_blocks(g, x, weight, bias, scale));
}

} // namespace semrover
