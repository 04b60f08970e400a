// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/network_blocks.h"

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
    const FeatureMap n = normalize(g, b.norm1, norm, x, x2);
    const FeatureMap h = convolve(g, w, b.conv1, n, {}, {shift, {}});
    const FeatureMap m = normalize(g, b.norm2, norm, with_moments(g, h));
    FeatureMap residual = x.x;
    if (b.shortcut.weight.valid())
        residual =
            conv2d(g, x.x, x2.x, b.shortcut.weight.in(g), b.shortcut.bias.in(g), {.kernel = 1, .dtype = w.precision()});
    return convolve(g, w, b.conv2, m, {}, {{}, residual});
}

FeatureMap convolve(Graph& g, const NetworkWeights& w, const Layer& layer, FeatureMap x, ConvOptions options,
                    const ConvAddends& addends)
{
    options.dtype = w.precision();
    return convolution(g, x, layer.weight.in(g), layer.bias.in(g), options, addends);
}

Tensor project(Graph& g, const NetworkWeights& w, const Layer& layer, Tensor x)
{
    return gemm(g, x, layer.weight.in(g), layer.bias.in(g), {.dtype = w.precision()});
}

FeatureMap normalize(Graph& g, const Layer& norm, const GroupNormOptions& options, NormInput x, NormInput x2)
{
    return group_norm(g, x, x2, norm.weight.in(g), norm.bias.in(g), options);
}

FrameResnet declare_frame_resnet(NetworkWeights& w, const std::string& name, const FrameResnetShape& s)
{
    const std::string block = name + ".temporal_res_block";
    NetworkWeights::ConvShape conv{.outputs = s.channels, .channels = s.channels};
    conv.gain = conv.bias_gain = s.stream;
    conv.frames = true;
    FrameResnet b;
    b.groups = s.groups;
    b.eps = s.eps;
    b.stream = s.stream;
    b.norm1 = w.norm(block + ".norm1", s.channels);
    b.conv1 = w.conv(block + ".conv1", conv);
    b.norm2 = w.norm(block + ".norm2", s.channels);
    conv.share = {name + ".time_mixer.mix_factor", s.switched};
    b.conv2 = w.conv(block + ".conv2", conv);
    return b;
}

FeatureMap convolve_frames(Graph& g, const Layer& layer, const FeatureMap& x, uint32_t frames, DType dtype)
{
    ConvOptions options;
    options.taps = {.height = 3, .width = 1, .padding_y = 1};
    options.dtype = dtype;
    const FeatureMap y = conv2d(g, frames_as_rows(x, frames), {}, layer.weight.in(g), layer.bias.in(g), options);
    return x.with(y.data);
}

FeatureMap frame_resnet(Graph& g, const NetworkWeights& w, const FrameResnet& b, NormInput x, uint32_t frames,
                        const ChannelShift& shift)
{
    GroupNormOptions norm;
    norm.groups = b.groups;
    norm.images = frames;
    norm.eps = b.eps * b.stream * b.stream; // the norm of stream * x is that of x
    norm.silu = true;
    norm.dtype = w.precision();
    FeatureMap h = convolve_frames(g, b.conv1, normalize(g, b.norm1, norm, x), frames, w.precision());
    if (shift.table.valid())
        h.data = channel_shift(g, frames_as_rows(h, frames), shift).data;
    const FeatureMap m = normalize(g, b.norm2, norm, with_moments(g, h));
    const FeatureMap y = convolve_frames(g, b.conv2, m, frames, w.precision());
    return y.with(add(g, y.data, x.x.data));
}

} // namespace semrover
