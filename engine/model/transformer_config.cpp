// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/transformer_config.h"

#include "runtime/base/json_fields.h"

#include <algorithm>

namespace semrover {

namespace {

Status read_normalization(const Json& json, TransformerConfig& config)
{
    if (!json.contains("normalization") || json["normalization"].is_null())
        return {};
    const Json& n = json["normalization"];
    TransformerConfig::Normalization out;
    for (const auto& [name, target] : {std::pair{"mean", &out.mean}, std::pair{"std", &out.std}}) {
        if (!n.is_object() || !n.contains(name) || !n[name].is_array() || n[name].size() != 6)
            return fail(ErrorCode::bad_input, "config: normalization.{} must hold 6 numbers", name);
        for (size_t i = 0; i < 6; ++i) {
            if (!n[name][i].is_number())
                return fail(ErrorCode::bad_input, "config: normalization.{}[{}] is not a number", name, i);
            (*target)[i] = n[name][i].get<float>();
        }
    }
    for (float s : out.std)
        if (!(s > 0))
            return fail(ErrorCode::bad_input, "config: normalization.std must be positive");
    config.normalization = out;
    return {};
}

} // namespace

uint32_t TransformerConfig::condition_width() const
{
    uint32_t width = 0;
    for (ConditionPart part : condition)
        width += semrover::condition_width(part);
    return width;
}

int32_t TransformerConfig::radius2_of(double metres) const
{
    // 1e-6 m as in the reference: distances between voxel centres that equal the radius count
    const double cells = (metres + 1e-6) / double(voxel_size);
    return int32_t(std::floor(cells * cells));
}

Result<TransformerConfig> parse_transformer_config(const Json& json)
{
    TransformerConfig c;
    JsonFields fields(json, "config");
    fields.only("_class_name", "VoxfieldTransformer");
    fields.only("prediction_type", "sample");
    fields.integer("num_layers", 1u, 1024u, c.num_layers);
    fields.integer("num_attention_heads", 1u, 1024u, c.num_attention_heads);
    fields.integer("attention_head_dim", 8u, 256u, c.attention_head_dim);
    fields.integer("points_per_voxel", 1u, 682u, c.points_per_voxel);
    fields.integer("num_classes", 1u, 65536u, c.num_classes);
    fields.integer("pos_embed_dim", 2u, 65536u, c.pos_embed_dim);
    fields.number("voxel_size", 1e-4f, 250.f, c.voxel_size);
    fields.number("attention_radius", 0.f, 1e5f, c.attention_radius);
    fields.flag("context_pos_embed", c.context_pos_embed);
    fields.choice<bool>("qk_norm", {{"rms_norm", true}}, c.qk_norm);
    fields.choice<bool>("weights", {{"q8_0", true}}, c.q8_0);
    fields.choices<ConditionPart>(
        "condition", {{"object", ConditionPart::object}, {"tint", ConditionPart::tint}, {"part", ConditionPart::part}},
        c.condition);
    fields.flag("condition_voxels", c.condition_voxels);
    fields.choice<std::string>("placement", {{"shifted", "shifted"}, {"canonical", "canonical"}, {"mixed", "mixed"}},
                               c.placement);
    if (std::ranges::any_of(c.condition, [&](ConditionPart p) { return std::ranges::count(c.condition, p) > 1; }))
        fields.refuse("condition", "a list of different names");
    if (c.condition_voxels && c.condition.empty())
        fields.refuse("condition_voxels", "false without a condition");
    if (c.attention_head_dim % 8)
        fields.refuse("attention_head_dim", "multiples of 8");
    if (c.pos_embed_dim % 2)
        fields.refuse("pos_embed_dim", "even numbers");
    for (const char* name : {"in_channels", "out_channels"})
        if (const Json* value = fields.find(name); value && *value != c.channels())
            fields.refuse(name, fmt::format("6 * points_per_voxel, {}", c.channels()));
    fields.ignore("normalization");
    SR_CHECK(fields.finish(c.warnings));
    SR_CHECK(read_normalization(json, c));
    return c;
}

Result<TransformerConfig> read_transformer_config(const Path& folder)
{
    const Path path = folder / "config.json";
    SR_TRY(const Json json, read_json(path));
    auto config = parse_transformer_config(json);
    if (!config)
        config.error().message = path.string() + ": " + config.error().message;
    return config;
}

} // namespace semrover
