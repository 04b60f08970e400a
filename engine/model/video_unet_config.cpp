// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/schema.h"
#include "engine/model/unet_config.h"
#include "runtime/base/json_fields.h"

#include <algorithm>

namespace semrover {

namespace {

void read_video_blocks(JsonFields& fields, UnetConfig& c)
{
    fields.list("block_out_channels", kMaxLevels, 1, kMaxChannels, c.block_out_channels);
    fields.choices<bool>("down_block_types",
                         {{"CrossAttnDownBlockSpatioTemporal", true}, {"DownBlockSpatioTemporal", false}},
                         c.down_attention);
    fields.choices<bool>("up_block_types", {{"CrossAttnUpBlockSpatioTemporal", true}, {"UpBlockSpatioTemporal", false}},
                         c.up_attention);
    const std::string count = fmt::format("as many as block_out_channels, {}", c.levels());
    if (c.down_attention.size() != c.levels())
        fields.refuse("down_block_types", count);
    if (c.up_attention.size() != c.levels())
        fields.refuse("up_block_types", count);
    c.layers_per_block.assign(c.levels(), 2);
    fields.integers("layers_per_block", c.levels(), 1, 64, c.layers_per_block);
}

void read_video_attention(JsonFields& fields, UnetConfig& c)
{
    c.heads = {5, 10, 20, 20};
    if (c.heads.size() != c.levels() && !fields.find("num_attention_heads"))
        fields.refuse("num_attention_heads", fmt::format("as many as block_out_channels, {}", c.levels()));
    fields.integers("num_attention_heads", c.levels(), 1, 1024, c.heads);
    c.transformer_layers.assign(c.levels(), 1);
    fields.integers("transformer_layers_per_block", c.levels(), 1, 64, c.transformer_layers);
    std::vector<uint32_t> widths(c.levels(), 1024);
    fields.integers("cross_attention_dim", c.levels(), 1, kMaxChannels, widths);
    if (std::ranges::adjacent_find(widths, std::ranges::not_equal_to()) != widths.end())
        fields.refuse("cross_attention_dim", "the same number at every level");
    c.cross_attention_dim = widths[0];
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

Status check_video(const UnetConfig& c)
{
    for (size_t i = 0; i < c.levels(); ++i) {
        const uint32_t channels = c.block_out_channels[i];
        if (channels % c.norm_num_groups)
            return fail(ErrorCode::bad_input, "video unet config: {} channels at level {} do not divide into {} groups",
                        channels, i, c.norm_num_groups);
        const bool attends = c.down_attention[i] || c.up_attention[c.levels() - 1 - i] || i + 1 == c.levels();
        if (attends && channels % c.heads[i])
            return fail(ErrorCode::bad_input, "video unet config: {} channels at level {} do not divide into {} heads",
                        channels, i, c.heads[i]);
    }
    return {};
}

} // namespace

Result<UnetConfig> parse_video_unet_config(const Json& json)
{
    UnetConfig c;
    c.video = true;
    c.in_channels = 8;
    c.use_linear_projection = true;
    c.num_frames = 25;
    JsonFields fields(json, "video unet config");
    fields.only("_class_name", "UNetSpatioTemporalConditionModel");
    fields.integer("in_channels", 1u, 4096u, c.in_channels);
    fields.integer("out_channels", 1u, 4096u, c.out_channels);
    read_video_blocks(fields, c);
    read_video_attention(fields, c);
    read_added_numbers(fields, c);
    fields.integer("num_frames", 1u, 4096u, c.num_frames);
    fields.ignore({"sample_size", "dropout"});
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_video(c));
    return c;
}

} // namespace semrover
