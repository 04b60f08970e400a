// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/unet_config.h"
#include "engine/model/vae_config.h"

#include <string_view>

namespace semrover {

// what a single-file LDM checkpoint calls the tensor that diffusers calls `name`, one of the network's schema; without
// the file's prefix (docs/models.md §9)
std::string ldm_unet_name(const UnetConfig& config, std::string_view name);
std::string ldm_vae_name(const VaeConfig& config, std::string_view name);

constexpr std::string_view kLdmUnet = "model.diffusion_model.";
constexpr std::string_view kLdmVae[] = {"first_stage_model.", "vae."}; // either

} // namespace semrover
