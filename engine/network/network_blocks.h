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

// y = conv(x) + shift + residual, by Winograd's algorithm or directly, whichever the device prefers
[[nodiscard]] FeatureMap convolve(Graph& g, const NetworkWeights& weights, const Layer& layer, FeatureMap x,
                                  ConvOptions options = {}, const ConvAddends& addends = {});
// y = x w^T + b
[[nodiscard]] Tensor project(Graph& g, const NetworkWeights& weights, const Layer& layer, Tensor x);
// y = norm(x, x2), as group_norm()
[[nodiscard]] FeatureMap normalize(Graph& g, const Layer& norm, const GroupNormOptions& options, NormInput x,
                                   NormInput x2 = {});

} // namespace semrover
