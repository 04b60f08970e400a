// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// per head of q and k: y = x / sqrt(mean(x^2) + eps) * weight; v is copied: [groups * M, 3D] -> [groups * M, 3D]
#include "kernels/network.h"

#include "head_rms_norm.spv.h"

namespace semrover {

Tensor head_rms_norm(Graph& g, Tensor qkv, Tensor weights, uint32_t heads, float eps, uint32_t groups)
{
    const uint32_t head_dim = qkv.cols / (3 * heads);
    SR_ASSERT(head_dim % 8 == 0 && weights.rows == 2 * groups && weights.cols == head_dim,
              "head_rms_norm: weights [{}, {}]", weights.rows, weights.cols);
    const Tensor y = g.matrix(qkv.rows, qkv.cols, qkv.dtype, "head_rms_norm");
    HeadRmsNormPush push{};
    push.rows = qkv.rows / groups;
    push.groups = groups;
    push.heads = heads;
    push.head_dim = head_dim;
    push.x_ld = qkv.ld;
    push.y_ld = y.ld;
    push.weight_ld = weights.ld;
    push.eps = eps;
    g.dispatch(kernel::head_rms_norm, {{"X", qkv}, {"Weight", weights}, {"Y", y}}, push, threads(qkv.rows * 3 * heads));
    return y;
}

} // namespace semrover
