// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/schema.h"
#include "engine/model/unet_fields.h"

namespace semrover {

namespace {

void read_video_attention(JsonFields& fields, UnetConfig& c)
{
    c.heads = {5, 10, 20, 20};
    if (c.heads.size() != c.levels() && !fields.find("num_attention_heads"))
        fields.refuse("num_attention_heads", fmt::format("as many as block_out_channels, {}", c.levels()));
    fields.integers("num_attention_heads", c.levels(), 1, 1024, c.heads);
    read_transformers(fields, c);
}

void read_added_numbers(JsonFields& fields, UnetConfig& c)
{
    uint32_t width = 768;
    c.added_embed_dim = 256;
    fields.integer("addition_time_embed_dim", 2u, kMaxChannels, c.added_embed_dim);
    fields.integer("projection_class_embeddings_input_dim", 2u, kMaxChannels, width);
    if (c.added_embed_dim % 2)
        fields.refuse("addition_time_embed_dim", "an even number");
    if (width % c.added_embed_dim)
        fields.refuse("projection_class_embeddings_input_dim",
                      fmt::format("a multiple of addition_time_embed_dim, {}", c.added_embed_dim));
    c.added_numbers = width / c.added_embed_dim;
}

} // namespace

Result<UnetConfig> parse_video_unet_config(const Json& json)
{
    UnetConfig c;
    c.video = true;
    c.in_channels = 8;
    c.use_linear_projection = true;
    c.cross_attention_dim = 1024;
    c.num_frames = 25;
    JsonFields fields(json, "video unet config");
    fields.only("_class_name", kVideoUnetClass);
    fields.integer("in_channels", 1u, 4096u, c.in_channels);
    fields.integer("out_channels", 1u, 4096u, c.out_channels);
    read_block_types(fields, {{"CrossAttnDownBlockSpatioTemporal", true}, {"DownBlockSpatioTemporal", false}},
                     {{"CrossAttnUpBlockSpatioTemporal", true}, {"UpBlockSpatioTemporal", false}}, c);
    read_layers(fields, c);
    read_video_attention(fields, c);
    read_added_numbers(fields, c);
    fields.integer("num_frames", 1u, 4096u, c.num_frames);
    fields.ignore({"sample_size", "dropout"});
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_channels(c, "video unet config", ""));
    return c;
}

Json video_unet_config_json(const UnetConfig& c)
{
    return {{"_class_name", kVideoUnetClass},
            {"in_channels", c.in_channels},
            {"out_channels", c.out_channels},
            {"block_out_channels", c.block_out_channels},
            {"layers_per_block", per_level_json(c.layers_per_block)},
            {"down_block_types", block_types_json(c.down_attention, "DownBlockSpatioTemporal")},
            {"up_block_types", block_types_json(c.up_attention, "UpBlockSpatioTemporal")},
            {"num_attention_heads", c.heads},
            {"transformer_layers_per_block", per_level_json(c.transformer_layers)},
            {"cross_attention_dim", c.cross_attention_dim},
            {"addition_time_embed_dim", c.added_embed_dim},
            {"projection_class_embeddings_input_dim", c.added_embed_dim * c.added_numbers},
            {"num_frames", c.num_frames}};
}

} // namespace semrover
