// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/unet_config.h"
#include "runtime/base/json_fields.h"

// what configs of UNets of images and of videos have alike
namespace semrover {

using BlockTypes = JsonFields::Names<bool>; // name, and whether such a block has attention

void read_block_types(JsonFields& fields, BlockTypes down, BlockTypes up, UnetConfig& c);
// refuses lists of another length than block_out_channels
void read_layers(JsonFields& fields, UnetConfig& c);
// layers of a transformer; the text's width, one number: lists of other networks differ per level
void read_transformers(JsonFields& fields, UnetConfig& c);
constexpr const char* kVideoUnetClass = "UNetSpatioTemporalConditionModel";

// one number where they are all the same
Json per_level_json(const std::vector<uint32_t>& values);
// name: of a block without attention
Json block_types_json(const std::vector<bool>& attention, const char* name);
// unet_config_json() of a UNet of videos
Json video_unet_config_json(const UnetConfig& config);

// channels divide into groups and heads. what: begins a message; of_heads: ends the one about heads
Status check_channels(const UnetConfig& c, std::string_view what, std::string_view of_heads);

} // namespace semrover
