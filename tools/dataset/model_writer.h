// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"

namespace semrover {

// a component's folder in the diffusers layout
struct ComponentFiles {
    Json config;
    std::vector<TensorStream> tensors;
};

// config.json and diffusion_pytorch_model.safetensors, or that many shards and their index; folders are made.
// errors: bad_input
Status write_component(const Path& folder, const ComponentFiles& files, uint32_t shards = 1);

Status write_json(const Path& path, const Json& json); // folders are made

// conv_in's weight [N, 4, 3, 3] with `channels` inputs; the new ones are zero, so that the network starts as it was
TensorStream widen_conv_in(TensorStream conv_in, uint32_t channels);

// a weight of fp32, fp16 or bf16 numbers as q8_0: its int8, and its scales (engine/model/weight_blocks.h)
TensorStream block_values(const TensorStream& weight);
TensorStream block_scales(const TensorStream& weight);

// a VAE's quant_conv, weight and bias, that changes nothing: for files that have none, in a layout that wants one
std::vector<TensorStream> identity_quant_conv(uint32_t latent_channels, DType dtype);

} // namespace semrover
