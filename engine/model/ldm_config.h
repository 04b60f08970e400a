// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/unet_config.h"
#include "engine/model/vae_config.h"

#include <string_view>

namespace semrover {

// Derives the configs of a single-file LDM checkpoint, of images or of videos, which has none (docs/models.md §9).
// Widths, layers, attention and kinds of projections follow from names and shapes. The rest is as in Stable Diffusion:
// 8 heads, or heads of 64 channels where the text is 1024 wide (2.x); 32 groups, or what divides all widths, with a
// warning. The metadata entry "semrover.config", JSON {"unet": {...}, "vae": {...}} in diffusers' terms, overrides all
// of this. errors: bad_input
bool is_ldm(const SafetensorsSet& set);
Result<UnetConfig> ldm_unet_config(const SafetensorsSet& set);
Result<VaeConfig> ldm_vae_config(const SafetensorsSet& set);

// the prefix of the VAE's tensors; empty: the file has none
std::string_view ldm_vae_prefix(const SafetensorsSet& set);

// what a single-file LDM checkpoint calls the tensor that diffusers calls `name`, one of the network's schema; without
// the file's prefix (docs/models.md §9)
std::string ldm_unet_name(const UnetConfig& config, std::string_view name);
std::string ldm_vae_name(const VaeConfig& config, std::string_view name);

constexpr std::string_view kLdmUnet = "model.diffusion_model.";
constexpr std::string_view kLdmVae[] = {"first_stage_model.", "vae."}; // either

} // namespace semrover
