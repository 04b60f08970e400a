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

// config.json of an AutoencoderKL (diffusers), or of an AutoencoderKLTemporalDecoder
struct VaeConfig {
    uint32_t in_channels = 3, out_channels = 3, latent_channels = 4;
    std::vector<uint32_t> block_out_channels = {128, 256, 512, 512};
    uint32_t layers_per_block = 2; // encoder; the decoder has one more
    uint32_t norm_num_groups = 32;
    float scaling_factor = 0.18215f;
    float shift_factor = 0;
    bool force_upcast = true; // activations may exceed fp16
    bool use_quant_conv = true, use_post_quant_conv = true;
    bool mid_block_add_attention = true;
    bool video = false;                // AutoencoderKLTemporalDecoder: the decoder sees the frames of a video together
    std::vector<std::string> warnings; // fields that the engine does not know

    uint32_t downscale() const { return 1u << (block_out_channels.size() - 1); } // pixels of a latent pixel
};

// errors: bad_input; a value that the engine does not implement is refused by name
Result<VaeConfig> parse_vae_config(const nlohmann::json& json);
// the same of an AutoencoderKLTemporalDecoder
Result<VaeConfig> parse_video_vae_config(const nlohmann::json& json);
// the same of either, as _class_name says; without one of images
Result<VaeConfig> parse_any_vae_config(const nlohmann::json& json);
// the config as a config.json
nlohmann::json vae_config_json(const VaeConfig& config);

// names and shapes of the network's weights, as diffusers calls them
std::vector<TensorSpec> vae_schema(const VaeConfig& config);

} // namespace semrover
