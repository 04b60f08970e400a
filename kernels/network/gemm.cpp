// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(x w^T): x [groups * M, K], w [groups * N, K] -> y [groups * M, N]
#include "kernels/network.h"

#include "gemm.spv.h"
#include "kernels/network/matmul_tiles.h"
#include "shaders/network/gemm.h"

namespace semrover {

Tensor gemm(Graph& g, Tensor x, Tensor w, Tensor bias, const GemmOptions& options)
{
    const uint32_t groups = options.groups;
    SR_ASSERT(x.cols == w.cols, "gemm: x [{}, {}] {} and w [{}, {}] {}", x.rows, x.cols, dtype_name(x.dtype), w.rows,
              w.cols, dtype_name(w.dtype));
    SR_ASSERT(x.rows % groups == 0 && w.rows % groups == 0, "gemm: {} and {} rows in {} groups", x.rows, w.rows,
              groups);
    GemmPush push{};
    push.rows = x.rows / groups;
    push.cols = w.rows / groups;
    push.depth = round_up(x.cols, kRowPadding);
    push.x_ld = x.ld;
    push.w_ld = w.ld;
    SR_ASSERT(!bias.valid() || (bias.rows == groups && bias.cols == push.cols && bias.dtype == DType::f32),
              "gemm: bias [{}, {}] for {} columns in {} groups", bias.rows, bias.cols, push.cols, groups);
    push.bias_ld = bias.ld;
    const Tensor y =
        options.part.valid() ? options.part.of(x.rows, push.cols) : g.matrix(x.rows, push.cols, options.dtype, "gemm");
    SR_ASSERT(y.dtype == options.dtype, "gemm: {} written to {}", dtype_name(options.dtype), dtype_name(y.dtype));
    push.y_ld = y.ld;
    DispatchOptions dispatch;
    dispatch.variant = &g.variant(kernel::gemm, {}, std::vector{x, w});
    MatmulTiles made =
        matmul_tiles(*dispatch.variant, g.limits(), {push.rows, push.cols, groups, {push.depth}}, options.tile);
    push.col_lanes = made.col_lanes;
    dispatch.alternatives = std::move(made.alternatives);
    dispatch.flops = 2.0 * x.rows * push.cols * x.cols;
    dispatch.constants = group_constants(g.limits(), {{"kBias", bias.valid()}});
    if (groups == 1)
        dispatch.banded = {"X", "Y"};
    g.dispatch(kernel::gemm, {{"X", x}, {"W", w}, {"Bias", bias}, {"Y", y}}, push, tiles(push.rows, push.cols, groups),
               std::move(dispatch));
    return y;
}

} // namespace semrover
