// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/pointnet.h"

#include "runtime/base/json_fields.h"
#include "runtime/base/keyed_random.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <map>

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

using Column = std::pair<int32_t, int32_t>;
using Point = std::array<float, 3>;

uint64_t scatter(uint64_t x) // one to one
{
    return mix64(x + kMixStep);
}

Result<std::map<Column, std::vector<uint32_t>>> columns_of(const ScenePoints& scene, double chunk)
{
    std::map<Column, std::vector<uint32_t>> columns;
    for (size_t i = 0; i < scene.size(); ++i) {
        const Point& p = scene.positions[i];
        const double x = std::floor(p[0] / chunk), y = std::floor(p[1] / chunk);
        if (!(std::abs(x) < 1 << 30 && std::abs(y) < 1 << 30 && std::isfinite(p[2])))
            return fail(ErrorCode::bad_input, "point {} lies at {}, {}, {}", i, p[0], p[1], p[2]);
        columns[{int32_t(x), int32_t(y)}].push_back(uint32_t(i));
    }
    return columns;
}

struct Limits {
    Point low{}, high{};
};
Limits limits_of(const ScenePoints& scene)
{
    Limits l{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (const Point& p : scene.positions)
        for (size_t a = 0; a < 3; ++a) {
            l.low[a] = std::min(l.low[a], p[a]);
            l.high[a] = std::max(l.high[a], p[a]);
        }
    return l;
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

Result<PointChunks> cut_chunks(const ScenePoints& scene, const PointnetConfig& config, uint64_t seed)
{
    using Input = PointnetConfig::Input;
    SR_TRY(auto columns, columns_of(scene, config.chunk));
    const Limits limits = limits_of(scene);
    PointChunks y{0, config.points, config.input_width(), {}, {}, 0};
    for (auto& [column, points] : columns) {
        if (points.size() < config.min_points) {
            ++y.left_out;
            continue;
        }
        std::ranges::sort(points, {}, [&](uint32_t i) { return scatter(scatter(seed) ^ i); });
        float lowest = INFINITY;
        for (const uint32_t i : points)
            lowest = std::min(lowest, scene.positions[i][2]);
        const std::array<double, 3> origin = {(column.first + 0.5) * config.chunk, (column.second + 0.5) * config.chunk,
                                              lowest};
        for (uint32_t n = 0; n < config.points; ++n) {
            const uint32_t i = points[n % points.size()];
            Point own, normalized;
            for (size_t a = 0; a < 3; ++a) {
                const float extent = limits.high[a] - limits.low[a];
                own[a] = float(scene.positions[i][a] - origin[a]);
                normalized[a] = extent > 0 ? (scene.positions[i][a] - limits.low[a]) / extent : 0;
            }
            y.positions.insert(y.positions.end(), {own[0], own[1], own[2], 0});
            for (const Input input : config.inputs) {
                const Point& v = input == Input::xyz ? own : input == Input::rgb ? scene.colors[i] : normalized;
                y.inputs.insert(y.inputs.end(), v.begin(), v.end());
            }
        }
        ++y.count;
    }
    return y;
}

} // namespace semrover
