// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/ldm_config.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <numeric>

namespace semrover {

namespace {

constexpr uint32_t kGroups = 32, kHeads = 8, kHeadWidth = 64;
constexpr size_t kMostBlocks = 1024; // of a list in the file

// shapes of a part of the file; the first tensor that is not there, or has another rank, is remembered
class Shapes {
  public:
    Shapes(const SafetensorsSet& set, std::string_view prefix) : set_(set), prefix_(prefix) {}

    bool has(const std::string& name) const { return set_.find(prefix_ + name) != nullptr; }

    size_t rank(const std::string& name) const
    {
        const TensorInfo* tensor = set_.find(prefix_ + name);
        return tensor ? tensor->shape.size() : 0;
    }

    uint32_t dim(const std::string& name, size_t axis)
    {
        const TensorInfo* tensor = set_.find(prefix_ + name);
        if (tensor && axis < tensor->shape.size() && tensor->shape[axis] > 0 && tensor->shape[axis] <= 65536)
            return uint32_t(tensor->shape[axis]);
        if (wrong_.empty())
            wrong_ = fmt::format("tensor {} is {}", quote(prefix_ + name),
                                 tensor ? "of shape " + shape_text(tensor->shape) : "missing");
        return 1;
    }

    // entries "name.0", "name.1", ... that have `tensor`
    uint32_t count(const std::string& name, const std::string& tensor) const
    {
        uint32_t n = 0;
        while (n < kMostBlocks && has(fmt::format("{}.{}.{}", name, n, tensor)))
            ++n;
        return n;
    }

    Status finish(std::string_view what) const
    {
        if (wrong_.empty())
            return {};
        return fail(ErrorCode::bad_input, "{}: cannot tell the {}'s shape: {}", quote_path(set_.path()), what, wrong_);
    }

  private:
    const SafetensorsSet& set_;
    std::string prefix_, wrong_;
};

// the part of the file's own config, if it has one; its text is the file's, so it is read with bounds
Result<Json> own_config(const SafetensorsSet& set, const char* part)
{
    const auto& metadata = set.shards()[0].metadata();
    const auto entry = metadata.find("semrover.config");
    if (entry == metadata.end())
        return Json();
    const std::string where = quote_path(set.path()) + ": semrover.config";
    SR_TRY(const Json json, parse_json(entry->second, where));
    return json.is_object() ? json.value(part, Json()) : Json();
}

uint32_t common_groups(const std::vector<uint32_t>& channels, std::vector<std::string>& warnings)
{
    uint32_t groups = kGroups;
    for (const uint32_t c : channels)
        groups = std::gcd(groups, c);
    if (groups != kGroups)
        warnings.push_back(
            fmt::format("a checkpoint without a config: {} normalization groups are a guess, its channels do not "
                        "divide into {}",
                        groups, kGroups));
    return groups;
}

struct Transformer {
    bool there = false;
    uint32_t layers = 1;
};

// the attention part of an entry of input_blocks or output_blocks; context width and projections are the network's
Transformer read_transformer(Shapes& s, const std::string& name, UnetConfig& c)
{
    if (!s.has(name + ".norm.weight"))
        return {};
    c.use_linear_projection = s.rank(name + ".proj_in.weight") == 2;
    c.cross_attention_dim = s.dim(name + ".transformer_blocks.0.attn2.to_k.weight", 1);
    return {true, std::max(1u, s.count(name + ".transformer_blocks", "norm1.weight"))};
}

void read_down_blocks(Shapes& s, UnetConfig& c)
{
    c.block_out_channels.clear();
    c.layers_per_block.clear();
    c.down_attention.clear();
    c.transformer_layers.clear();
    bool new_level = true;
    for (size_t i = 1; i < kMostBlocks; ++i) {
        const std::string block = fmt::format("input_blocks.{}", i);
        if (s.has(block + ".0.op.weight")) {
            new_level = true;
            continue;
        }
        if (!s.has(block + ".0.in_layers.0.weight"))
            break;
        if (new_level) {
            const Transformer t = read_transformer(s, block + ".1", c);
            c.block_out_channels.push_back(s.dim(block + ".0.out_layers.3.weight", 0));
            c.layers_per_block.push_back(0);
            c.down_attention.push_back(t.there);
            c.transformer_layers.push_back(t.layers);
        }
        new_level = false;
        ++c.layers_per_block.back();
    }
}

// what shapes do not show is as in Stable Video Diffusion: three numbers come with a video
void read_video(Shapes& s, UnetConfig& c)
{
    c.added_numbers = 3;
    c.added_embed_dim = std::max(2u, s.dim("label_emb.0.0.weight", 1) / c.added_numbers);
    c.num_frames = 25;
}

void read_up_blocks(Shapes& s, UnetConfig& c)
{
    c.up_attention.clear();
    size_t first = 0;
    for (size_t i = 0; i < c.levels(); ++i) {
        const size_t level = c.levels() - 1 - i;
        const Transformer t = read_transformer(s, fmt::format("output_blocks.{}.1", first), c);
        c.up_attention.push_back(t.there);
        if (t.there)
            c.transformer_layers[level] = t.layers;
        first += c.layers_per_block[level] + 1;
    }
}

} // namespace

bool is_ldm(const SafetensorsSet& set)
{
    return set.find(std::string(kLdmUnet) + "input_blocks.0.0.weight") != nullptr;
}

std::string_view ldm_vae_prefix(const SafetensorsSet& set)
{
    for (const std::string_view prefix : kLdmVae)
        if (set.find(std::string(prefix) + "encoder.conv_in.weight"))
            return prefix;
    return {};
}

Result<UnetConfig> ldm_unet_config(const SafetensorsSet& set)
{
    SR_TRY(const Json own, own_config(set, "unet"));
    if (!own.is_null())
        return parse_any_unet_config(own);
    Shapes s(set, kLdmUnet);
    UnetConfig c;
    c.video = s.has("input_blocks.1.0.time_stack.in_layers.0.weight");
    c.in_channels = s.dim("input_blocks.0.0.weight", 1);
    c.out_channels = s.dim("out.2.weight", 0);
    read_down_blocks(s, c);
    if (c.block_out_channels.empty())
        s.dim("input_blocks.1.0.in_layers.0.weight", 0);
    SR_CHECK(s.finish("UNet"));
    if (const Transformer mid = read_transformer(s, "middle_block.1", c); mid.there)
        c.transformer_layers.back() = mid.layers;
    read_up_blocks(s, c);
    if (s.has("label_emb.weight"))
        c.num_class_embeds = s.dim("label_emb.weight", 0);
    SR_CHECK(s.finish("UNet"));
    c.heads.clear();
    for (const uint32_t channels : c.block_out_channels)
        c.heads.push_back(c.cross_attention_dim == 1024 ? std::max(1u, channels / kHeadWidth) : kHeads);
    std::vector<std::string> warnings;
    if (c.video)
        read_video(s, c);
    else
        c.norm_num_groups = common_groups(c.block_out_channels, warnings);
    SR_CHECK(s.finish("UNet"));
    SR_TRY(c, parse_any_unet_config(unet_config_json(c))); // what a file may say is checked in one place
    c.warnings = std::move(warnings);
    return c;
}

Result<VaeConfig> ldm_vae_config(const SafetensorsSet& set)
{
    SR_TRY(const Json own, own_config(set, "vae"));
    if (!own.is_null())
        return parse_any_vae_config(own);
    Shapes s(set, ldm_vae_prefix(set));
    VaeConfig c;
    c.in_channels = s.dim("encoder.conv_in.weight", 1);
    c.out_channels = s.dim("decoder.conv_out.weight", 0);
    c.latent_channels = s.dim("decoder.conv_in.weight", 1);
    c.block_out_channels.clear();
    const uint32_t levels = s.count("encoder.down", "block.0.norm1.weight");
    for (uint32_t i = 0; i < levels; ++i)
        c.block_out_channels.push_back(s.dim(fmt::format("encoder.down.{}.block.0.conv1.weight", i), 0));
    if (levels == 0)
        s.dim("encoder.down.0.block.0.norm1.weight", 0);
    c.layers_per_block = s.count("encoder.down.0.block", "norm1.weight");
    c.use_quant_conv = s.has("quant_conv.weight");
    c.use_post_quant_conv = s.has("post_quant_conv.weight");
    c.mid_block_add_attention = s.has("encoder.mid.attn_1.norm.weight");
    c.video = s.has("decoder.conv_out.time_mix_conv.weight");
    SR_CHECK(s.finish("VAE"));
    std::vector<std::string> warnings;
    if (!c.video)
        c.norm_num_groups = common_groups(c.block_out_channels, warnings);
    const bool quant_conv = c.use_quant_conv; // which a config of videos does not say
    SR_TRY(c, parse_any_vae_config(vae_config_json(c)));
    c.use_quant_conv = quant_conv;
    c.warnings = std::move(warnings);
    return c;
}

} // namespace semrover
