// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/network_weights.h"
#include "kernels/network.h"

namespace semrover {

// Blocks that UNets and VAEs share: declare_*() lays out a block's weights once, the other functions add it to a graph.

// a feature map and its statistics, for a group norm; both are lazy
NormInput with_moments(Graph& g, FeatureMap x);

// h = conv1(silu(norm1(x))) + shift;  y = conv2(silu(norm2(h))) + shortcut(x)
struct ResnetBlock {
    Layer norm1, conv1, norm2, conv2, shortcut;
    uint32_t groups = 32;
    float eps = 1e-5f;
    float stream = 1; // x and y are stored multiplied by this
};
struct ResnetShape {
    uint32_t channels, channels2 = 0, outputs, groups;
    float eps = 1e-5f, stream = 1;
};
ResnetBlock declare_resnet(NetworkWeights& weights, const std::string& name, const ResnetShape& shape);
[[nodiscard]] FeatureMap resnet(Graph& g, const NetworkWeights& weights, const ResnetBlock& block, NormInput x,
                                NormInput x2, const ChannelShift& shift = {});

// y = conv(x) + shift + residual, as convolution()
[[nodiscard]] FeatureMap convolve(Graph& g, const NetworkWeights& weights, const Layer& layer, FeatureMap x,
                                  ConvOptions options = {}, const ConvAddends& addends = {});
// y = x w^T + b
[[nodiscard]] Tensor project(Graph& g, const NetworkWeights& weights, const Layer& layer, Tensor x);
// y = norm(x, x2), as group_norm()
[[nodiscard]] FeatureMap normalize(Graph& g, const Layer& norm, const GroupNormOptions& options, NormInput x,
                                   NormInput x2 = {});

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
    bool switched = false; // the time mixer's share: FrameShare
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
