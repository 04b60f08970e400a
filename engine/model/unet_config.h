// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"
#include "runtime/base/safetensors.h"

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace semrover {

// config.json of a UNet2DConditionModel (diffusers), as far as Stable-Diffusion-1.5-shaped networks use it, or of a
// UNetSpatioTemporalConditionModel, as Stable Video Diffusion has it
struct UnetConfig {
    uint32_t in_channels = 4, out_channels = 4;
    std::vector<uint32_t> block_out_channels = {320, 640, 1280, 1280};
    std::vector<uint32_t> layers_per_block = {2, 2, 2, 2};        // down blocks; an up block has one more
    std::vector<bool> down_attention = {true, true, true, false}; // CrossAttnDownBlock2D or DownBlock2D
    std::vector<bool> up_attention = {false, true, true, true};
    // UNetMidBlock2DCrossAttn: resnets.0, attentions.0, resnets.1; or UNetMidBlock2D: resnets.0 alone
    bool mid_attention = true;
    std::vector<uint32_t> heads = {8, 8, 8, 8};              // per level; the file's attention_head_dim (sic)
    std::vector<uint32_t> transformer_layers = {1, 1, 1, 1}; // per level
    uint32_t cross_attention_dim = 768;
    uint32_t norm_num_groups = 32;
    float norm_eps = 1e-5f;
    bool use_linear_projection = false;
    bool flip_sin_to_cos = true;
    float freq_shift = 0;
    bool q8_0 = false;                 // weights of its blocks are (weight_blocks.h)
    uint32_t num_class_embeds = 0;     // rows of class_embedding; 0: none
    bool video = false;                // UNetSpatioTemporalConditionModel
    uint32_t added_embed_dim = 0;      // of a video: of each number that comes with it, such as frames a second
    uint32_t added_numbers = 0;        // how many they are
    uint32_t num_frames = 0;           // that it was trained on
    std::vector<std::string> warnings; // fields that the engine does not know

    size_t levels() const { return block_out_channels.size(); }
    uint32_t time_embed_dim() const { return 4 * block_out_channels[0]; }
    // eps of the group norms in resnets; diffusers' blocks of videos have two
    float down_eps(size_t level) const { return video && down_attention[level] ? 1e-6f : norm_eps; }
    float up_eps() const { return video ? 1e-6f : norm_eps; }
};

// errors: bad_input; a value that the engine does not implement is refused by name
Result<UnetConfig> parse_unet_config(const nlohmann::json& json);
// the same of a UNetSpatioTemporalConditionModel
Result<UnetConfig> parse_video_unet_config(const nlohmann::json& json);
// the same of either, as _class_name says; without one of images
Result<UnetConfig> parse_any_unet_config(const nlohmann::json& json);
// the config as a config.json
nlohmann::json unet_config_json(const UnetConfig& config);

// names and shapes of the network's weights, as diffusers calls them
std::vector<TensorSpec> unet_schema(const UnetConfig& config);

} // namespace semrover
