// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/network_blocks.h"

namespace semrover {

// What diffusers' SpatioTemporalResBlock does after its ResnetBlock2D. Group norms take the statistics of all frames of
// a video, convolutions reach to the frames around; with the share of the time mixer in the weights of conv2,
//     h = conv1(silu(norm1(x))) + shift;  y = x + share conv2(silu(norm2(h)))
struct FrameResnet {
    Layer norm1, conv1, norm2, conv2;
    uint32_t groups = 32;
    float eps = 1e-5f;
    float stream = 1; // x and y are stored multiplied by this
};
struct FrameResnetShape {
    uint32_t channels, groups;
    float eps = 1e-5f, stream = 1;
    bool switched = false; // the time mixer's share: NetworkWeights::FrameShare
};
// name: of the SpatioTemporalResBlock
FrameResnet declare_frame_resnet(NetworkWeights& weights, const std::string& name, const FrameResnetShape& shape);

// shift: a table row a video
[[nodiscard]] FeatureMap frame_resnet(Graph& g, const NetworkWeights& weights, const FrameResnet& block, NormInput x,
                                      uint32_t frames, const ChannelShift& shift = {});

// y = conv(x) of a layer whose taps lie along time
[[nodiscard]] FeatureMap convolve_frames(Graph& g, const Layer& layer, const FeatureMap& x, uint32_t frames,
                                         DType dtype);

} // namespace semrover
