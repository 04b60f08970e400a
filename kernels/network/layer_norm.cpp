// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * weight + bias: [M, N] -> [M, N]
#include "kernels/network.h"

#include "kernels/network/row_norm.h"
#include "layer_norm.spv.h"
#include "shaders/network/layer_norm.h"

namespace semrover {

Tensor layer_norm(Graph& g, Tensor x, Tensor weight, Tensor bias, float eps)
{
    SR_ASSERT(weight.cols == x.cols && bias.cols == x.cols && weight.dtype == DType::f32 && bias.dtype == DType::f32,
              "layer_norm: rows of {}, weight of {}, bias of {}", x.cols, weight.cols, bias.cols);
    const Tensor y = g.matrix(x.rows, x.cols, x.dtype, "layer_norm");
    const LayerNormPush push{.rows = x.rows, .cols = x.cols, .x_ld = x.ld, .y_ld = y.ld, .eps = eps};
    DispatchOptions options;
    options.variant = &g.variant(kernel::layer_norm);
    options.constants = {{"kKept", kept_sweeps(x.cols)}};
    options.banded = {"X", "Y"};
    g.dispatch(kernel::layer_norm, {{"X", x}, {"Weight", weight}, {"Bias", bias}, {"Y", y}}, push,
               row_tiles(x.rows, options.variant->value("kTileM")), std::move(options));
    return y;
}

} // namespace semrover
