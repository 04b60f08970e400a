// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/unet_fields.h"

#include "engine/model/schema.h"

#include <algorithm>

namespace semrover {

namespace {

bool has_attention(const UnetConfig& c, size_t level)
{
    return c.down_attention[level] || c.up_attention[c.levels() - 1 - level] ||
           (level + 1 == c.levels() && c.mid_attention);
}

} // namespace

void read_block_types(JsonFields& fields, BlockTypes down, BlockTypes up, UnetConfig& c)
{
    fields.list("block_out_channels", kMaxLevels, 1, kMaxChannels, c.block_out_channels);
    fields.choices<bool>("down_block_types", down, c.down_attention);
    fields.choices<bool>("up_block_types", up, c.up_attention);
}

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

Json per_level_json(const std::vector<uint32_t>& values)
{
    const bool same = std::ranges::count(values, values[0]) == std::ptrdiff_t(values.size());
    return same ? Json(values[0]) : Json(values);
}

Json block_types_json(const std::vector<bool>& attention, const char* name)
{
    Json list = Json::array();
    for (const bool a : attention)
        list.push_back((a ? "CrossAttn" : "") + std::string(name));
    return list;
}

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
    }
    return {};
}

} // namespace semrover
