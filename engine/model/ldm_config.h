// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/unet_config.h"
#include "engine/model/vae_config.h"

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

} // namespace semrover
