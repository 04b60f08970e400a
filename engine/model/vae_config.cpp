// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/vae_config.h"

#include "engine/model/schema.h"
#include "runtime/base/json_fields.h"

namespace semrover {

namespace {

constexpr const char* kVideoVaeClass = "AutoencoderKLTemporalDecoder";

void read_block_types(JsonFields& fields, const VaeConfig& c, const char* name, const char* type)
{
    std::vector<bool> blocks(c.block_out_channels.size());
    fields.choices<bool>(name, {{type, true}}, blocks);
    if (blocks.size() != c.block_out_channels.size())
        fields.refuse(name, fmt::format("as many as block_out_channels, {}", c.block_out_channels.size()));
}

void read_blocks(JsonFields& fields, VaeConfig& c)
{
    fields.list("block_out_channels", kMaxLevels, 1, kMaxChannels, c.block_out_channels);
    read_block_types(fields, c, "down_block_types", "DownEncoderBlock2D");
    if (!c.video)
        read_block_types(fields, c, "up_block_types", "UpDecoderBlock2D");
    std::vector<uint32_t> layers(c.block_out_channels.size(), c.layers_per_block);
    fields.integers("layers_per_block", layers.size(), 1, 64, layers);
    for (const uint32_t n : layers)
        if (n != layers[0])
            fields.refuse("layers_per_block", "the same number at every level");
    c.layers_per_block = layers[0];
}

void add_mid_attention(Schema& s, const std::string& name, uint32_t channels)
{
    s.norm(name + ".group_norm", channels);
    for (const char* part : {".to_q", ".to_k", ".to_v", ".to_out.0"})
        s.linear(name + part, channels, channels);
}

void add_mid_block(Schema& s, const std::string& name, const VaeConfig& c)
{
    const uint32_t channels = c.block_out_channels.back();
    s.resnet(name + ".resnets.0", channels, channels);
    if (c.mid_block_add_attention)
        add_mid_attention(s, name + ".attentions.0", channels);
    s.resnet(name + ".resnets.1", channels, channels);
}

void add_video_mid_block(Schema& s, const std::string& name, const VaeConfig& c)
{
    const uint32_t channels = c.block_out_channels.back();
    for (uint32_t i = 0; i < c.layers_per_block; ++i)
        s.video_resnet(fmt::format("{}.resnets.{}", name, i), channels, channels);
    add_mid_attention(s, name + ".attentions.0", channels);
}

void add_encoder(Schema& s, const VaeConfig& c)
{
    const size_t levels = c.block_out_channels.size();
    uint32_t in = c.block_out_channels[0];
    s.conv("encoder.conv_in", in, c.in_channels, 3);
    for (size_t i = 0; i < levels; ++i) {
        const std::string block = fmt::format("encoder.down_blocks.{}", i);
        const uint32_t out = c.block_out_channels[i];
        for (uint32_t j = 0; j < c.layers_per_block; ++j, in = out)
            s.resnet(fmt::format("{}.resnets.{}", block, j), in, out);
        if (i + 1 < levels)
            s.conv(block + ".downsamplers.0.conv", out, out, 3);
    }
    add_mid_block(s, "encoder.mid_block", c);
    s.norm("encoder.conv_norm_out", in);
    s.conv("encoder.conv_out", 2 * c.latent_channels, in, 3);
}

void add_decoder(Schema& s, const VaeConfig& c)
{
    const size_t levels = c.block_out_channels.size();
    uint32_t in = c.block_out_channels.back();
    s.conv("decoder.conv_in", in, c.latent_channels, 3);
    if (c.video)
        add_video_mid_block(s, "decoder.mid_block", c);
    else
        add_mid_block(s, "decoder.mid_block", c);
    for (size_t i = 0; i < levels; ++i) {
        const std::string block = fmt::format("decoder.up_blocks.{}", i);
        const uint32_t out = c.block_out_channels[levels - 1 - i];
        for (uint32_t j = 0; j < c.layers_per_block + 1; ++j, in = out) {
            const std::string layer = fmt::format("{}.resnets.{}", block, j);
            if (c.video)
                s.video_resnet(layer, in, out);
            else
                s.resnet(layer, in, out);
        }
        if (i + 1 < levels)
            s.conv(block + ".upsamplers.0.conv", out, out, 3);
    }
    s.norm("decoder.conv_norm_out", in);
    s.conv("decoder.conv_out", c.out_channels, in, 3);
    if (c.video)
        s.frame_conv("decoder.time_conv_out", c.out_channels, c.out_channels, 3);
}

// what both kinds have
void read_numbers(JsonFields& fields, VaeConfig& c)
{
    fields.integer("in_channels", 1u, 4096u, c.in_channels);
    fields.integer("out_channels", 1u, 4096u, c.out_channels);
    fields.integer("latent_channels", 1u, 4096u, c.latent_channels);
    read_blocks(fields, c);
    fields.number("scaling_factor", 1e-6f, 1e6f, c.scaling_factor);
    fields.flag("force_upcast", c.force_upcast);
    fields.ignore("sample_size");
}

Status check_groups(const VaeConfig& c)
{
    for (const uint32_t channels : c.block_out_channels)
        if (channels % c.norm_num_groups)
            return fail(ErrorCode::bad_input, "vae config: {} channels do not divide into {} groups", channels,
                        c.norm_num_groups);
    return {};
}

} // namespace

Result<VaeConfig> parse_vae_config(const Json& json)
{
    VaeConfig c;
    JsonFields fields(json, "vae config");
    fields.only("_class_name", "AutoencoderKL");
    read_numbers(fields, c);
    fields.integer("norm_num_groups", 1u, kMaxChannels, c.norm_num_groups);
    fields.number("shift_factor", -1e6f, 1e6f, c.shift_factor);
    fields.flag("use_quant_conv", c.use_quant_conv);
    fields.flag("use_post_quant_conv", c.use_post_quant_conv);
    fields.flag("mid_block_add_attention", c.mid_block_add_attention);
    bool silu = true;
    fields.choice<bool>("act_fn", {{"silu", true}, {"swish", true}}, silu);
    fields.only("latents_mean", nullptr);
    fields.only("latents_std", nullptr);
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_groups(c));
    return c;
}

Result<VaeConfig> parse_video_vae_config(const Json& json)
{
    VaeConfig c;
    c.video = true;
    c.use_post_quant_conv = false;
    JsonFields fields(json, "video vae config");
    fields.only("_class_name", kVideoVaeClass);
    read_numbers(fields, c);
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(check_groups(c));
    return c;
}

Result<VaeConfig> parse_any_vae_config(const Json& json)
{
    const bool video = json.is_object() && json.value("_class_name", Json()) == kVideoVaeClass;
    return video ? parse_video_vae_config(json) : parse_vae_config(json);
}

Json vae_config_json(const VaeConfig& c)
{
    const size_t levels = c.block_out_channels.size();
    if (c.video)
        return {{"_class_name", kVideoVaeClass},
                {"in_channels", c.in_channels},
                {"out_channels", c.out_channels},
                {"latent_channels", c.latent_channels},
                {"block_out_channels", c.block_out_channels},
                {"layers_per_block", c.layers_per_block},
                {"down_block_types", std::vector<std::string>(levels, "DownEncoderBlock2D")},
                {"scaling_factor", short_number(c.scaling_factor)},
                {"force_upcast", c.force_upcast}};
    return {{"_class_name", "AutoencoderKL"},
            {"in_channels", c.in_channels},
            {"out_channels", c.out_channels},
            {"latent_channels", c.latent_channels},
            {"block_out_channels", c.block_out_channels},
            {"layers_per_block", c.layers_per_block},
            {"down_block_types", std::vector<std::string>(levels, "DownEncoderBlock2D")},
            {"up_block_types", std::vector<std::string>(levels, "UpDecoderBlock2D")},
            {"act_fn", "silu"},
            {"norm_num_groups", c.norm_num_groups},
            {"scaling_factor", short_number(c.scaling_factor)},
            {"shift_factor", c.shift_factor != 0 ? short_number(c.shift_factor) : Json()},
            {"force_upcast", c.force_upcast},
            {"use_quant_conv", c.use_quant_conv},
            {"use_post_quant_conv", c.use_post_quant_conv},
            {"mid_block_add_attention", c.mid_block_add_attention}};
}

std::vector<TensorSpec> vae_schema(const VaeConfig& c)
{
    Schema s;
    add_encoder(s, c);
    add_decoder(s, c);
    if (c.use_quant_conv)
        s.conv("quant_conv", 2 * c.latent_channels, 2 * c.latent_channels, 1);
    if (c.use_post_quant_conv)
        s.conv("post_quant_conv", c.latent_channels, c.latent_channels, 1);
    return std::move(s.specs);
}

} // namespace semrover
