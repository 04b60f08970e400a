// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = conv(x, w) + bias + shift + residual, by Winograd's algorithm or directly: the only place that chooses
#include "kernels/network.h"

namespace semrover {

FeatureMap convolution(Graph& g, FeatureMap x, Tensor w, Tensor bias, const ConvOptions& options,
                       const ConvAddends& addends)
{
    if (prefers_winograd(g.limits(), x, w.rows, options))
        return winograd_conv2d(g, x, winograd_weight(g, w), bias, options, addends);
    FeatureMap y = conv2d(g, x, {}, w, bias, options);
    if (addends.shift.table.valid())
        y = channel_shift(g, y, addends.shift);
    return addends.residual.valid() ? y.with(add(g, y.data, addends.residual.data)) : y;
}

} // namespace semrover
