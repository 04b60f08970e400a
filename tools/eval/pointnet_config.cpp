// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/pointnet_config.h"

#include "runtime/base/json_fields.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

constexpr size_t kMaxLayers = 8, kMaxWidths = 8;
constexpr uint32_t kMaxPoints = 65536, kMaxWidth = 4096;

Result<SetAbstraction> read_layer(const Json& json, const std::string& where, uint32_t points,
                                  std::vector<std::string>& warnings)
{
    SetAbstraction layer;
    JsonFields fields(json, where);
    fields.integer("npoint", 1u, points, layer.npoint);
    fields.integer("nsample", 1u, 1024u, layer.nsample);
    fields.number("radius", 1e-4f, 1e4f, layer.radius);
    fields.list("mlp", kMaxWidths, 1, kMaxWidth, layer.mlp);
    SR_CHECK(fields.finish(warnings));
    if (!layer.npoint || !layer.nsample || layer.radius <= 0 || layer.mlp.empty())
        return fail(ErrorCode::bad_input, "{}: npoint, radius, nsample and mlp are needed", where);
    return layer;
}

} // namespace

Result<PointnetConfig> read_pointnet_config(const Path& path, std::vector<std::string>& warnings)
{
    SR_TRY(const Json json, read_json(path));
    PointnetConfig c;
    using Input = PointnetConfig::Input;
    using Pool = PointnetConfig::Pool;
    const std::string where = quote_path(path);
    JsonFields fields(json, where);
    fields.choices<Input>("inputs", {{"xyz", Input::xyz}, {"rgb", Input::rgb}, {"normalized", Input::normalized}},
                          c.inputs);
    fields.number("chunk", 0.01, 1e5, c.chunk);
    fields.integer("points", 1u, kMaxPoints, c.points);
    fields.integer("min_points", 1u, kMaxPoints, c.min_points);
    fields.choice<Pool>("pool", {{"max", Pool::max}, {"mean", Pool::mean}}, c.pool);
    if (c.inputs.size() > 8)
        fields.refuse("inputs", "at most eight names");
    const Json* layers = fields.find("layers");
    if (!layers || !layers->is_array() || layers->empty() || layers->size() > kMaxLayers)
        fields.refuse("layers", fmt::format("a list of 1 to {} layers", kMaxLayers));
    SR_CHECK(fields.finish(warnings));
    uint32_t points = c.points; // what a layer can choose from
    for (size_t i = 0; i < layers->size(); ++i) {
        SR_TRY(SetAbstraction layer,
               read_layer((*layers)[i], fmt::format("{}: layer {}", where, i + 1), points, warnings));
        points = layer.npoint;
        c.layers.push_back(std::move(layer));
    }
    return c;
}

} // namespace semrover
