// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/unet_config.h"

#include "engine/model/schema.h"
#include "engine/model/weight_blocks.h"
#include "runtime/base/json_fields.h"
#include "runtime/graph/tensor.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr const char* kVideoUnetClass = "UNetSpatioTemporalConditionModel";
using BlockTypes = JsonFields::Names<bool>; // name, and whether such a block has attention

bool has_attention(const UnetConfig& c, size_t level)
{
    return c.down_attention[level] || c.up_attention[c.levels() - 1 - level] ||
           (level + 1 == c.levels() && c.mid_attention);
}

void read_block_types(JsonFields& fields, BlockTypes down, BlockTypes up, UnetConfig& c)
{
    fields.list("block_out_channels", kMaxLevels, 1, kMaxChannels, c.block_out_channels);
    fields.choices<bool>("down_block_types", down, c.down_attention);
    fields.choices<bool>("up_block_types", up, c.up_attention);
}

// refuses lists of another length than block_out_channels
void read_layers(JsonFields& fields, UnetConfig& c)
{
    const std::string count = fmt::format("as many as block_out_channels, {}", c.levels());
    if (c.down_attention.size() != c.levels())
        fields.refuse("down_block_types", count);
    if (c.up_attention.size() != c.levels())
        fields.refuse("up_block_types", count);
    c.layers_per_block.assign(c.levels(), 2);
    fields.integers("layers_per_block", c.levels(), 1, 64, c.layers_per_block);
}

// layers of a transformer; the text's width, one number: lists of other networks differ per level
void read_transformers(JsonFields& fields, UnetConfig& c)
{
    c.transformer_layers.assign(c.levels(), 1);
    fields.integers("transformer_layers_per_block", c.levels(), 1, 64, c.transformer_layers);
    std::vector<uint32_t> widths(c.levels(), c.cross_attention_dim);
    fields.integers("cross_attention_dim", c.levels(), 1, kMaxChannels, widths);
    if (std::ranges::adjacent_find(widths, std::ranges::not_equal_to()) != widths.end())
        fields.refuse("cross_attention_dim", "the same number at every level");
    c.cross_attention_dim = widths[0];
}

// one number where they are all the same
Json per_level_json(const std::vector<uint32_t>& values)
{
    const bool same = std::ranges::count(values, values[0]) == std::ptrdiff_t(values.size());
    return same ? Json(values[0]) : Json(values);
}

// name: of a block without attention
Json block_types_json(const std::vector<bool>& attention, const char* name)
{
    Json list = Json::array();
    for (const bool a : attention)
        list.push_back((a ? "CrossAttn" : "") + std::string(name));
    return list;
}

// channels divide into groups and heads. what: begins a message; of_heads: ends the one about heads
Status check_channels(const UnetConfig& c, std::string_view what, std::string_view of_heads)
{
    for (size_t i = 0; i < c.levels(); ++i) {
        const uint32_t channels = c.block_out_channels[i];
        if (channels % c.norm_num_groups)
            return fail(ErrorCode::bad_input, "{}: {} channels at level {} do not divide into {} groups", what,
                        channels, i, c.norm_num_groups);
        if (has_attention(c, i) && channels % c.heads[i])
            return fail(ErrorCode::bad_input, "{}: {} channels at level {} do not divide into {} heads{}", what,
                        channels, i, c.heads[i], of_heads);
        // else blocks would be torn apart by what the kernels pad
        if (const uint32_t head = has_attention(c, i) ? channels / c.heads[i] : channels;
            c.q8_0 && (channels % kRowPadding || head % kRowPadding))
            return fail(ErrorCode::bad_input,
                        "{}: weights \"q8_0\" want channels and heads of multiples of {}, "
                        "found {} channels at level {}, heads of {}",
                        what, kRowPadding, channels, i, head);
    }
    return {};
}

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

Json image_unet_config_json(const UnetConfig& c)
{
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
    fields.choice<bool>("weights", {{"q8_0", true}}, c.q8_0);
    fields.flag("flip_sin_to_cos", c.flip_sin_to_cos);
    fields.number("freq_shift", -16.f, 16.f, c.freq_shift);
    fields.integer("num_class_embeds", 0u, kMaxChannels, c.num_class_embeds);
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_together(c));
    return c;
}

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
    fields.choice<bool>("weights", {{"q8_0", true}}, c.q8_0);
    fields.ignore({"sample_size", "dropout"});
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_channels(c, "video unet config", ""));
    return c;
}

Result<UnetConfig> parse_any_unet_config(const Json& json)
{
    const bool video = json.is_object() && json.value("_class_name", Json()) == kVideoUnetClass;
    return video ? parse_video_unet_config(json) : parse_unet_config(json);
}

Json unet_config_json(const UnetConfig& c)
{
    Json json = c.video ? video_unet_config_json(c) : image_unet_config_json(c);
    if (c.q8_0)
        json["weights"] = "q8_0";
    return json;
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
    return c.q8_0 ? with_scales(std::move(s.specs)) : std::move(s.specs);
}

} // namespace semrover
