// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/frame_resnet.h"

namespace semrover {

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
