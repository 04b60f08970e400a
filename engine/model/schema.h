// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/safetensors.h"

namespace semrover {

// limits of a configuration
constexpr size_t kMaxLevels = 8;
constexpr uint32_t kMaxChannels = 65536;

// Collects names and shapes of a network's weights layer by layer, by PyTorch's names.
struct Schema {
    std::vector<TensorSpec> specs;

    void norm(const std::string& name, uint32_t channels)
    {
        specs.push_back({name + ".weight", {channels}});
        specs.push_back({name + ".bias", {channels}});
    }
    void matrix(const std::string& name, uint32_t out, uint32_t in) { specs.push_back({name, {out, in}}); }
    void linear(const std::string& name, uint32_t out, uint32_t in)
    {
        matrix(name + ".weight", out, in);
        specs.push_back({name + ".bias", {out}});
    }
    void conv(const std::string& name, uint32_t out, uint32_t in, uint32_t side)
    {
        specs.push_back({name + ".weight", {out, in, side, side}});
        specs.push_back({name + ".bias", {out}});
    }
    // taps along time only
    void frame_conv(const std::string& name, uint32_t out, uint32_t in, uint32_t taps)
    {
        specs.push_back({name + ".weight", {out, in, taps, 1, 1}});
        specs.push_back({name + ".bias", {out}});
    }

    // the rest: diffusers' blocks. time: width of the time embedding, 0 for none
    void resnet(const std::string& name, uint32_t in, uint32_t out, uint32_t time = 0);
    void frame_resnet(const std::string& name, uint32_t channels, uint32_t time = 0);         // TemporalResnetBlock
    void video_resnet(const std::string& name, uint32_t in, uint32_t out, uint32_t time = 0); // SpatioTemporalResBlock
    void attention(const std::string& name, uint32_t channels, uint32_t context); // without biases of q, k, v
    void feed_forward(const std::string& name, uint32_t channels);                // GEGLU
    void transformer_block(const std::string& name, uint32_t channels, uint32_t context);
};

} // namespace semrover
