// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/transformer_config.h"

#include "runtime/json.h"

#include <cmath>
#include <set>

namespace semrover {

namespace {

Status read(const Json& json, const char* name, uint32_t low, uint32_t high, uint32_t& value)
{
    if (!json.contains(name))
        return {};
    const Json& v = json[name];
    if (!v.is_number_unsigned() || v.get<uint64_t>() < low || v.get<uint64_t>() > high)
        return fail(ErrorCode::bad_input, "config: {} is {}, expected an integer in {}..{}", name, v.dump(), low, high);
    value = v.get<uint32_t>();
    return {};
}

Status read(const Json& json, const char* name, float low, float high, float& value)
{
    if (!json.contains(name))
        return {};
    const Json& v = json[name];
    if (!v.is_number() || !(v.get<float>() >= low && v.get<float>() <= high))
        return fail(ErrorCode::bad_input, "config: {} is {}, expected a number in {}..{}", name, v.dump(), low, high);
    value = v.get<float>();
    return {};
}

Status read_bool(const Json& json, const char* name, bool& value)
{
    if (json.contains(name) && !json[name].is_boolean())
        return fail(ErrorCode::bad_input, "config: {} is {}, expected true or false", name, json[name].dump());
    value = json.value(name, value);
    return {};
}

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

// names and the only value that is implemented
Status check_fixed(const Json& json)
{
    const auto expect = [&](const char* name, const char* value) -> Status {
        if (json.contains(name) && json[name] != value)
            return fail(ErrorCode::bad_input, "config: {} = {} is not implemented, only \"{}\"", name,
                        json[name].dump(), value);
        return {};
    };
    SR_CHECK(expect("_class_name", "VoxfieldTransformer"));
    return expect("prediction_type", "sample");
}

void collect_unknown(const Json& json, TransformerConfig& config)
{
    static const std::set<std::string> kKnown = {
        "_class_name",       "_diffusers_version", "num_layers", "num_attention_heads", "attention_head_dim",
        "points_per_voxel",  "num_classes",        "voxel_size", "attention_radius",    "pos_embed_dim",
        "context_pos_embed", "prediction_type",    "qk_norm",    "normalization",       "in_channels",
        "out_channels",      "_name_or_path"};
    for (const auto& [name, value] : json.items())
        if (!kKnown.count(name))
            config.warnings.push_back(fmt::format("config: field '{}' is not known and has no effect", name));
}

} // namespace

int32_t TransformerConfig::radius2() const
{
    // 1e-6 m as in the reference: distances between cell centres that equal the radius count
    const double cells = (double(attention_radius) + 1e-6) / double(voxel_size);
    return int32_t(std::floor(cells * cells));
}

Result<TransformerConfig> parse_transformer_config(const Json& json)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "config: expected a JSON object");
    TransformerConfig c;
    SR_CHECK(check_fixed(json));
    SR_CHECK(read(json, "num_layers", 1u, 1024u, c.num_layers));
    SR_CHECK(read(json, "num_attention_heads", 1u, 1024u, c.num_attention_heads));
    SR_CHECK(read(json, "attention_head_dim", 8u, 256u, c.attention_head_dim));
    SR_CHECK(read(json, "points_per_voxel", 1u, 682u, c.points_per_voxel));
    SR_CHECK(read(json, "num_classes", 1u, 65536u, c.num_classes));
    SR_CHECK(read(json, "pos_embed_dim", 2u, 65536u, c.pos_embed_dim));
    SR_CHECK(read(json, "voxel_size", 1e-4f, 1e4f, c.voxel_size));
    SR_CHECK(read(json, "attention_radius", 0.f, 1e5f, c.attention_radius));
    SR_CHECK(read_bool(json, "context_pos_embed", c.context_pos_embed));
    SR_CHECK(read_normalization(json, c));
    if (c.attention_head_dim % 8)
        return fail(ErrorCode::bad_input, "config: attention_head_dim {} is not implemented, only multiples of 8",
                    c.attention_head_dim);
    if (c.pos_embed_dim % 2)
        return fail(ErrorCode::bad_input, "config: pos_embed_dim {} must be even", c.pos_embed_dim);
    if (json.contains("qk_norm") && !json["qk_norm"].is_null()) {
        if (json["qk_norm"] != "rms_norm")
            return fail(ErrorCode::bad_input, "config: qk_norm = {} is not implemented, only \"rms_norm\"",
                        json["qk_norm"].dump());
        c.qk_norm = true;
    }
    for (const char* name : {"in_channels", "out_channels"})
        if (json.contains(name) && json[name] != c.channels())
            return fail(ErrorCode::bad_input, "config: {} is {}, but 6 * points_per_voxel is {}", name,
                        json[name].dump(), c.channels());
    collect_unknown(json, c);
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
