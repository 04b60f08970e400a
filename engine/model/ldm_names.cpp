// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/ldm_config.h"

#include <algorithm>
#include <charconv>
#include <span>

namespace semrover {

namespace {

using Parts = std::vector<std::string_view>; // of a name, between its dots

struct Renamed {
    std::string_view from, to;
};

constexpr Renamed kUnetTop[] = {{"conv_in", "input_blocks.0.0"},
                                {"time_embedding.linear_1", "time_embed.0"},
                                {"time_embedding.linear_2", "time_embed.2"},
                                {"class_embedding", "label_emb"},
                                {"add_embedding.linear_1", "label_emb.0.0"},
                                {"add_embedding.linear_2", "label_emb.0.2"},
                                {"conv_norm_out", "out.0"},
                                {"conv_out", "out.2"},
                                {"mid_block.resnets.0", "middle_block.0"},
                                {"mid_block.attentions.0", "middle_block.1"},
                                {"mid_block.resnets.1", "middle_block.2"}};
constexpr Renamed kUnetResnet[] = {{"norm1", "in_layers.0"},          {"conv1", "in_layers.2"},
                                   {"time_emb_proj", "emb_layers.1"}, {"norm2", "out_layers.0"},
                                   {"conv2", "out_layers.3"},         {"conv_shortcut", "skip_connection"}};
// of a transformer of videos
constexpr Renamed kFrameTransformer[] = {{"temporal_transformer_blocks", "time_stack"},
                                         {"time_pos_embed.linear_1", "time_pos_embed.0"},
                                         {"time_pos_embed.linear_2", "time_pos_embed.2"}};
constexpr Renamed kVaeTop[] = {{"mid_block.resnets.0", "mid.block_1"},
                               {"mid_block.resnets.1", "mid.block_2"},
                               {"mid_block.attentions.0", "mid.attn_1"},
                               {"conv_norm_out", "norm_out"},
                               {"time_conv_out", "conv_out.time_mix_conv"}};
constexpr Renamed kVaeResnet[] = {{"conv_shortcut", "nin_shortcut"}};
constexpr Renamed kVaeAttention[] = {
    {"group_norm", "norm"}, {"to_q", "q"}, {"to_k", "k"}, {"to_v", "v"}, {"to_out.0", "proj_out"}};

Parts split(std::string_view name)
{
    Parts parts;
    for (size_t dot; (dot = name.find('.')) != std::string_view::npos; name.remove_prefix(dot + 1))
        parts.push_back(name.substr(0, dot));
    parts.push_back(name);
    return parts;
}

size_t index_of(std::string_view part)
{
    size_t value = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    SR_ASSERT(error == std::errc() && end == part.data() + part.size(), "'{}' is no index", part);
    return value;
}

std::string rest_of(const Parts& parts, size_t first)
{
    return fmt::format("{}", fmt::join(parts.begin() + std::ptrdiff_t(first), parts.end(), "."));
}

// replaces the name's beginning, where the table has it, up to a dot
std::string rename(std::string_view name, std::span<const Renamed> table)
{
    for (const Renamed& r : table)
        if (name.starts_with(r.from) && name.substr(r.from.size()).starts_with('.'))
            return std::string(r.to) + std::string(name.substr(r.from.size()));
    return std::string(name);
}

// the layer's place in LDM's list: [resnet, attention, upsampler]; a downsampler stands alone
std::string place(std::string_view list, size_t index, size_t slot, const std::string& rest)
{
    return fmt::format("{}.{}.{}.{}", list, index, slot, rest);
}

// of a resnet: `names` are those of an image's; one of a video has such a part, and one over its frames
std::string resnet_name(std::string_view name, std::span<const Renamed> names)
{
    constexpr std::string_view kSpatial = "spatial_res_block.", kTemporal = "temporal_res_block.";
    if (name.starts_with(kSpatial))
        return rename(name.substr(kSpatial.size()), names);
    if (name.starts_with(kTemporal))
        return "time_stack." + rename(name.substr(kTemporal.size()), kUnetResnet);
    return rename(name, names);
}

std::string layer_name(std::string_view list, size_t index, const Parts& parts)
{
    const bool resnet = parts[2] == "resnets";
    const std::string rest = rest_of(parts, 4);
    return place(list, index, resnet ? 0 : 1,
                 resnet ? resnet_name(rest, kUnetResnet) : rename(rest, kFrameTransformer));
}

// a down block is its layers and, but for the last block, a downsampler; input block 0 is conv_in
std::string down_name(const UnetConfig& c, const Parts& parts)
{
    size_t index = 1;
    const size_t level = index_of(parts[1]);
    for (size_t i = 0; i < level; ++i)
        index += c.layers_per_block[i] + 1;
    if (parts[2] == "downsamplers")
        return place("input_blocks", index + c.layers_per_block[level], 0, "op." + rest_of(parts, 5));
    return layer_name("input_blocks", index + index_of(parts[3]), parts);
}

// an up block has a layer more, and its upsampler is in the last one's list
std::string up_name(const UnetConfig& c, const Parts& parts)
{
    size_t index = 0;
    const size_t block = index_of(parts[1]), last = c.levels() - 1;
    for (size_t i = 0; i < block; ++i)
        index += c.layers_per_block[last - i] + 1;
    if (parts[2] == "upsamplers")
        return place("output_blocks", index + c.layers_per_block[last - block], c.up_attention[block] ? 2 : 1,
                     rest_of(parts, 4));
    return layer_name("output_blocks", index + index_of(parts[3]), parts);
}

std::string vae_resnet_name(std::string_view name)
{
    return name == "time_mixer.mix_factor" ? "mix_factor" : resnet_name(name, kVaeResnet);
}

// encoder.down_blocks.1.resnets.0.conv1.weight and its like
std::string vae_block_name(const VaeConfig& c, const Parts& parts)
{
    const bool down = parts[1] == "down_blocks";
    const size_t index = index_of(parts[2]), level = down ? index : c.block_out_channels.size() - 1 - index;
    const std::string block = fmt::format("{}.{}.{}", parts[0], down ? "down" : "up", level);
    if (parts[3] == "resnets")
        return fmt::format("{}.block.{}.{}", block, parts[4], vae_resnet_name(rest_of(parts, 5)));
    return fmt::format("{}.{}.{}", block, down ? "downsample" : "upsample", rest_of(parts, 5));
}

} // namespace

std::string ldm_unet_name(const UnetConfig& config, std::string_view name)
{
    const Parts parts = split(name);
    if (parts[0] == "down_blocks")
        return down_name(config, parts);
    if (parts[0] == "up_blocks")
        return up_name(config, parts);
    if (parts[0] == "mid_block" && parts[1] == "resnets")
        return rename(fmt::format("mid_block.resnets.{}.{}", parts[2], resnet_name(rest_of(parts, 3), kUnetResnet)),
                      kUnetTop);
    if (parts[0] == "mid_block")
        return rename(fmt::format("mid_block.attentions.{}.{}", parts[2], rename(rest_of(parts, 3), kFrameTransformer)),
                      kUnetTop);
    return rename(name, kUnetTop);
}

std::string ldm_vae_name(const VaeConfig& config, std::string_view name)
{
    const Parts parts = split(name);
    if (parts[0] != "encoder" && parts[0] != "decoder")
        return std::string(name);
    if (parts[1] == "down_blocks" || parts[1] == "up_blocks")
        return vae_block_name(config, parts);
    std::string rest = rest_of(parts, 1);
    if (parts[1] == "mid_block" && parts[2] == "resnets")
        rest = fmt::format("mid_block.resnets.{}.{}", parts[3], vae_resnet_name(rest_of(parts, 4)));
    if (parts[1] == "mid_block" && parts[2] == "attentions")
        rest = "mid_block.attentions.0." + rename(rest_of(parts, 4), kVaeAttention);
    return std::string(parts[0]) + "." + rename(rest, kVaeTop);
}

} // namespace semrover
