// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/render/network_blocks.h"

namespace semrover {

NormInput with_moments(Graph& g, FeatureMap x)
{
    return {x, channel_moments(g, x)};
}

ResnetBlock declare_resnet(NetworkWeights& w, const std::string& name, const ResnetShape& s)
{
    const uint32_t channels = s.channels + s.channels2;
    ResnetBlock b;
    b.groups = s.groups;
    b.eps = s.eps;
    b.stream = s.stream;
    b.norm1 = w.norm(name + ".norm1", channels);
    b.conv1 =
        w.conv(name + ".conv1", {.outputs = s.outputs, .channels = channels, .gain = s.stream, .bias_gain = s.stream});
    b.norm2 = w.norm(name + ".norm2", s.outputs);
    b.conv2 =
        w.conv(name + ".conv2", {.outputs = s.outputs, .channels = s.outputs, .gain = s.stream, .bias_gain = s.stream});
    if (channels != s.outputs)
        b.shortcut = w.conv(name + ".conv_shortcut", {.outputs = s.outputs,
                                                      .channels = s.channels,
                                                      .channels2 = s.channels2,
                                                      .kernel = 1,
                                                      .bias_gain = s.stream});
    return b;
}

FeatureMap resnet(Graph& g, const NetworkWeights& w, const ResnetBlock& b, NormInput x, NormInput x2,
                  const ChannelShift& shift)
{
    GroupNormOptions norm;
    norm.groups = b.groups;
    norm.eps = b.eps * b.stream * b.stream; // the norm of stream * x is that of x
    norm.silu = true;
    norm.dtype = w.precision();
    const FeatureMap n =
        group_norm(g, x, x2, w.tensor(g, b.norm1.weight, "norm1"), w.tensor(g, b.norm1.bias, "norm1"), norm);
    FeatureMap h = convolve(g, w, b.conv1, n);
    if (shift.table.valid())
        h = channel_shift(g, h, shift);
    const FeatureMap m = norm_silu(g, w, b.norm2, with_moments(g, h), norm);
    FeatureMap residual = x.x;
    if (b.shortcut.weight.rows)
        residual = convolve(g, w, b.shortcut, x.x, {.kernel = 1}, x2.x);
    const FeatureMap y = convolve(g, w, b.conv2, m);
    return y.with(add(g, y.data, residual.data));
}

FeatureMap convolve(Graph& g, const NetworkWeights& w, const Layer& layer, FeatureMap x, ConvOptions options,
                    FeatureMap x2)
{
    options.dtype = w.precision();
    return conv2d(g, x, x2, w.tensor(g, layer.weight, "conv"), w.tensor(g, layer.bias, "conv.bias"), options);
}

Tensor project(Graph& g, const NetworkWeights& w, const Layer& layer, Tensor x)
{
    return gemm(g, x, w.tensor(g, layer.weight, "linear"), w.tensor(g, layer.bias, "linear.bias"),
                {.dtype = w.precision()});
}

FeatureMap norm_silu(Graph& g, const NetworkWeights& w, const Layer& norm, NormInput x, const GroupNormOptions& options)
{
    return group_norm(g, x, {}, w.tensor(g, norm.weight, "norm"), w.tensor(g, norm.bias, "norm.bias"), options);
}

} // namespace semrover
