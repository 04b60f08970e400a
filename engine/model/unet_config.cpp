// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/unet_config.h"

#include "engine/model/schema.h"
#include "engine/model/unet_fields.h"

#include <algorithm>

namespace semrover {

namespace {

void read_blocks(JsonFields& fields, UnetConfig& c)
{
    read_block_types(fields, {{"CrossAttnDownBlock2D", true}, {"DownBlock2D", false}},
                     {{"CrossAttnUpBlock2D", true}, {"UpBlock2D", false}}, c);
    fields.refuse_null("mid_block_type", "\"UNetMidBlock2DCrossAttn\", \"UNetMidBlock2D\"");
    fields.choice<bool>("mid_block_type", {{"UNetMidBlock2DCrossAttn", true}, {"UNetMidBlock2D", false}},
                        c.mid_attention);
    read_layers(fields, c);
}

void read_attention(JsonFields& fields, UnetConfig& c)
{
    c.heads.assign(c.levels(), 8);
    fields.integers("attention_head_dim", c.levels(), 1, 1024, c.heads);
    fields.integers("num_attention_heads", c.levels(), 1, 1024, c.heads);
    read_transformers(fields, c);
    fields.flag("use_linear_projection", c.use_linear_projection);
}

void refuse_the_rest(JsonFields& fields)
{
    fields.only("_class_name", "UNet2DConditionModel");
    fields.only("resnet_time_scale_shift", "default");
    fields.only("time_embedding_type", "positional");
    fields.only("attention_type", "default");
    bool silu = true;
    fields.choice<bool>("act_fn", {{"silu", true}, {"swish", true}}, silu);
    for (const char* name : {"center_input_sample", "only_cross_attention", "dual_cross_attention",
                             "resnet_skip_time_act", "class_embeddings_concat", "mid_block_only_cross_attention"})
        fields.only(name, false);
    for (const char* name : {"downsample_padding", "mid_block_scale_factor", "resnet_out_scale_factor"})
        fields.only(name, 1);
    for (const char* name : {"conv_in_kernel", "conv_out_kernel"})
        fields.only(name, 3);
    for (const char* name :
         {"class_embed_type", "addition_embed_type", "addition_time_embed_dim", "encoder_hid_dim",
          "encoder_hid_dim_type", "reverse_transformer_layers_per_block", "time_embedding_dim", "time_embedding_act_fn",
          "timestep_post_act", "time_cond_proj_dim", "projection_class_embeddings_input_dim", "cross_attention_norm"})
        fields.only(name, nullptr);
    // training's, a hint for callers, or what only matters with something refused above; sums are always fp32
    fields.ignore({"sample_size", "dropout", "addition_embed_type_num_heads", "upcast_attention"});
}

Status check_together(const UnetConfig& c)
{
    SR_CHECK(check_channels(c, "unet config", " (attention_head_dim is their number)"));
    if (c.block_out_channels[0] % 2)
        return fail(ErrorCode::bad_input, "unet config: block_out_channels[0] {} must be even",
                    c.block_out_channels[0]);
    return {};
}

// ---- the weights

void add_resnet(Schema& s, const std::string& name, const UnetConfig& c, uint32_t in, uint32_t out)
{
    if (c.video)
        s.video_resnet(name, in, out, c.time_embed_dim());
    else
        s.resnet(name, in, out, c.time_embed_dim());
}

// what a transformer of a video has beside that of an image
void add_frame_blocks(Schema& s, const std::string& name, const UnetConfig& c, size_t level)
{
    const uint32_t channels = c.block_out_channels[level];
    for (uint32_t k = 0; k < c.transformer_layers[level]; ++k) {
        const std::string block = fmt::format("{}.temporal_transformer_blocks.{}", name, k);
        s.norm(block + ".norm_in", channels);
        s.feed_forward(block + ".ff_in", channels);
        s.transformer_block(block, channels, c.cross_attention_dim);
    }
    s.linear(name + ".time_pos_embed.linear_1", 4 * channels, channels);
    s.linear(name + ".time_pos_embed.linear_2", channels, 4 * channels);
    s.specs.push_back({name + ".time_mixer.mix_factor", {1}});
}

void add_transformer(Schema& s, const std::string& name, const UnetConfig& c, size_t level)
{
    const uint32_t channels = c.block_out_channels[level];
    const auto projection = [&](const char* which) {
        if (c.use_linear_projection)
            s.linear(name + which, channels, channels);
        else
            s.conv(name + which, channels, channels, 1);
    };
    s.norm(name + ".norm", channels);
    projection(".proj_in");
    for (uint32_t k = 0; k < c.transformer_layers[level]; ++k)
        s.transformer_block(fmt::format("{}.transformer_blocks.{}", name, k), channels, c.cross_attention_dim);
    if (c.video)
        add_frame_blocks(s, name, c, level);
    projection(".proj_out");
}

void add_down_block(Schema& s, const UnetConfig& c, size_t level)
{
    const uint32_t out = c.block_out_channels[level];
    uint32_t in = c.block_out_channels[level ? level - 1 : 0];
    const std::string block = fmt::format("down_blocks.{}", level);
    for (uint32_t j = 0; j < c.layers_per_block[level]; ++j) {
        add_resnet(s, fmt::format("{}.resnets.{}", block, j), c, in, out);
        if (c.down_attention[level])
            add_transformer(s, fmt::format("{}.attentions.{}", block, j), c, level);
        in = out;
    }
    if (level + 1 < c.levels())
        s.conv(block + ".downsamplers.0.conv", out, out, 3);
}

// an up block's last layer gets the skip of the level above, with that level's channels
void add_up_block(Schema& s, const UnetConfig& c, size_t index)
{
    const size_t level = c.levels() - 1 - index;
    const uint32_t out = c.block_out_channels[level], layers = c.layers_per_block[level] + 1;
    uint32_t in = c.block_out_channels[std::min(level + 1, c.levels() - 1)];
    const std::string block = fmt::format("up_blocks.{}", index);
    for (uint32_t j = 0; j < layers; ++j) {
        const uint32_t skip = j + 1 < layers ? out : c.block_out_channels[level ? level - 1 : 0];
        add_resnet(s, fmt::format("{}.resnets.{}", block, j), c, in + skip, out);
        if (c.up_attention[index])
            add_transformer(s, fmt::format("{}.attentions.{}", block, j), c, level);
        in = out;
    }
    if (level > 0)
        s.conv(block + ".upsamplers.0.conv", out, out, 3);
}

} // namespace

Result<UnetConfig> parse_unet_config(const Json& json)
{
    UnetConfig c;
    JsonFields fields(json, "unet config");
    refuse_the_rest(fields);
    fields.integer("in_channels", 1u, 4096u, c.in_channels);
    fields.integer("out_channels", 1u, 4096u, c.out_channels);
    read_blocks(fields, c);
    read_attention(fields, c);
    fields.refuse_null("norm_num_groups", "a whole number");
    fields.integer("norm_num_groups", 1u, kMaxChannels, c.norm_num_groups);
    fields.number("norm_eps", 1e-12f, 1.f, c.norm_eps);
    fields.flag("flip_sin_to_cos", c.flip_sin_to_cos);
    fields.number("freq_shift", -16.f, 16.f, c.freq_shift);
    fields.integer("num_class_embeds", 0u, kMaxChannels, c.num_class_embeds);
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_together(c));
    return c;
}

Result<UnetConfig> parse_any_unet_config(const Json& json)
{
    const bool video = json.is_object() && json.value("_class_name", Json()) == kVideoUnetClass;
    return video ? parse_video_unet_config(json) : parse_unet_config(json);
}

Json unet_config_json(const UnetConfig& c)
{
    if (c.video)
        return video_unet_config_json(c);
    return {{"_class_name", "UNet2DConditionModel"},
            {"in_channels", c.in_channels},
            {"out_channels", c.out_channels},
            {"block_out_channels", c.block_out_channels},
            {"layers_per_block", per_level_json(c.layers_per_block)},
            {"down_block_types", block_types_json(c.down_attention, "DownBlock2D")},
            {"mid_block_type", c.mid_attention ? "UNetMidBlock2DCrossAttn" : "UNetMidBlock2D"},
            {"up_block_types", block_types_json(c.up_attention, "UpBlock2D")},
            {"attention_head_dim", per_level_json(c.heads)},
            {"transformer_layers_per_block", per_level_json(c.transformer_layers)},
            {"cross_attention_dim", c.cross_attention_dim},
            {"norm_num_groups", c.norm_num_groups},
            {"norm_eps", short_number(c.norm_eps)},
            {"use_linear_projection", c.use_linear_projection},
            {"flip_sin_to_cos", c.flip_sin_to_cos},
            {"freq_shift", short_number(c.freq_shift)},
            {"num_class_embeds", c.num_class_embeds ? Json(c.num_class_embeds) : Json()}};
}

std::vector<TensorSpec> unet_schema(const UnetConfig& c)
{
    Schema s;
    const uint32_t first = c.block_out_channels.front(), last = c.block_out_channels.back();
    s.conv("conv_in", first, c.in_channels, 3);
    s.linear("time_embedding.linear_1", c.time_embed_dim(), first);
    s.linear("time_embedding.linear_2", c.time_embed_dim(), c.time_embed_dim());
    if (c.video) {
        s.linear("add_embedding.linear_1", c.time_embed_dim(), c.added_numbers * c.added_embed_dim);
        s.linear("add_embedding.linear_2", c.time_embed_dim(), c.time_embed_dim());
    }
    if (c.num_class_embeds)
        s.matrix("class_embedding.weight", c.num_class_embeds, c.time_embed_dim());
    for (size_t i = 0; i < c.levels(); ++i)
        add_down_block(s, c, i);
    add_resnet(s, "mid_block.resnets.0", c, last, last);
    if (c.mid_attention) {
        add_transformer(s, "mid_block.attentions.0", c, c.levels() - 1);
        add_resnet(s, "mid_block.resnets.1", c, last, last);
    }
    for (size_t i = 0; i < c.levels(); ++i)
        add_up_block(s, c, i);
    s.norm("conv_norm_out", first);
    s.conv("conv_out", c.out_channels, first, 3);
    return std::move(s.specs);
}

} // namespace semrover
