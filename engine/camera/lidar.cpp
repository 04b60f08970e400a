// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/lidar.h"

#include "lidar_json.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

using std::numbers::pi;
constexpr double kRadians = pi / 180;
constexpr size_t kMostBeams = 1024;
constexpr uint32_t kMostColumns = 65535;
constexpr double kSteepest = 89.9; // degrees; a beam along the axis has no azimuth
constexpr std::string_view kKeys[] = {"columns",    "rate",       "direction", "start", "range", "range_at_10_percent",
                                      "first_ring", "elevations", "azimuths",  "times", "every", "comment"};

// a number for each beam, `usual` where the key is missing
Result<std::vector<double>> beam_numbers(const Json& json, const char* key, size_t beams, double low, double high,
                                         double usual, std::string_view where)
{
    if (!json.contains(key))
        return std::vector<double>(beams, usual);
    const std::string at = fmt::format("{}: {}", where, key);
    SR_TRY(std::vector<double> values, numbers_of(json[key], at));
    if (values.size() != beams)
        return fail(ErrorCode::bad_input, "{}: expected a number for each of {} beams, found {}", at, beams,
                    values.size());
    for (const double value : values)
        if (!(value >= low && value <= high))
            return fail(ErrorCode::bad_input, "{}: expected numbers from {} to {}, found {}", at, low, high, value);
    return values;
}

Result<std::vector<double>> read_elevations(const Json& json, std::string_view where)
{
    if (!json.contains("elevations"))
        return fail(ErrorCode::bad_input, "{}: elevations is missing", where);
    const size_t beams = json["elevations"].is_array() ? json["elevations"].size() : 0;
    if (beams < 1 || beams > kMostBeams)
        return fail(ErrorCode::bad_input, "{}: elevations: expected an array of 1 to {} numbers", where, kMostBeams);
    SR_TRY(std::vector<double> values, beam_numbers(json, "elevations", beams, -kSteepest, kSteepest, 0, where));
    if (std::ranges::adjacent_find(values, std::less_equal<>()) != values.end())
        return fail(ErrorCode::bad_input, "{}: elevations: expected the beams from the top, each below the one before",
                    where);
    return values;
}

Status read_beams(const Json& json, Lidar& lidar, std::string_view where)
{
    SR_TRY(const std::vector<double> elevations, read_elevations(json, where));
    const size_t n = elevations.size();
    SR_TRY(const std::vector<double> azimuths, beam_numbers(json, "azimuths", n, -90, 90, 0, where));
    SR_TRY(const std::vector<double> delays, beam_numbers(json, "times", n, 0, 1e6 / lidar.rate, 0, where));
    SR_TRY(const std::vector<double> every, beam_numbers(json, "every", n, 1, lidar.columns, 1, where));
    for (size_t i = 0; i < n; ++i) {
        if (every[i] != std::floor(every[i]))
            return fail(ErrorCode::bad_input, "{}: every: expected whole numbers, found {}", where, every[i]);
        lidar.beams.push_back({elevations[i] * kRadians,
                               azimuths[i] * kRadians + delays[i] / lidar.column_microseconds() * lidar.step(),
                               delays[i], uint32_t(every[i])});
    }
    return {};
}

} // namespace

double Lidar::step() const
{
    return (clockwise ? 2 : -2) * pi / columns;
}

double Lidar::firing_microseconds(uint32_t beam, uint32_t column) const
{
    return column_microseconds() * column + beams[beam].delay;
}

uint32_t Lidar::ring(uint32_t beam) const
{
    return first_ring_on_top ? beam : uint32_t(beams.size()) - 1 - beam;
}

Point3 Lidar::ray(uint32_t beam, uint32_t column) const
{
    const double azimuth = start + step() * column + beams[beam].azimuth, up = beams[beam].elevation;
    return {std::cos(up) * std::cos(azimuth), -std::cos(up) * std::sin(azimuth), std::sin(up)};
}

Result<Lidar> parse_lidar(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kKeys, where));
    for (const char* key : {"columns", "rate", "range"})
        if (!json.contains(key))
            return fail(ErrorCode::bad_input, "{}: {} is missing", where, key);
    Lidar lidar;
    double start = 180;
    SR_TRY(const auto range, numbers_at<2>(json, "range", where));
    std::tie(lidar.nearest, lidar.farthest) = std::pair(range[0], range[1]);
    lidar.farthest_at_tenth = lidar.farthest;
    JsonFields fields(json, std::string(where));
    fields.integer("columns", 4u, kMostColumns, lidar.columns);
    fields.number("rate", 0.1, 1000.0, lidar.rate);
    fields.choice("direction", {{"clockwise", true}, {"counterclockwise", false}}, lidar.clockwise);
    fields.number("start", -360.0, 360.0, start);
    fields.number("range_at_10_percent", 0.01, 1e5, lidar.farthest_at_tenth);
    fields.choice("first_ring", {{"top", true}, {"bottom", false}}, lidar.first_ring_on_top);
    std::vector<std::string> unread;
    SR_CHECK(fields.finish(unread));
    if (!(lidar.nearest >= 0.01 && lidar.nearest < lidar.farthest && lidar.farthest <= 1e5))
        return fail(ErrorCode::bad_input, "{}: range: expected metres from 0.01 to 100000, the nearest first, found {}",
                    where, fmt::join(range, ", "));
    lidar.start = start * kRadians;
    SR_CHECK(read_beams(json, lidar, where));
    lidar.table = json;
    return lidar;
}

Result<Lidar> read_lidar(const Path& path)
{
    SR_TRY(const Json json, read_json(path));
    return parse_lidar(json, quote_path(path));
}

Result<Lidar> named_lidar(std::string_view name)
{
    const auto found = std::ranges::find(kLidarAssets, name, &LidarAsset::name);
    if (found == std::end(kLidarAssets)) {
        std::vector<std::string_view> names;
        for (const LidarAsset& asset : kLidarAssets)
            names.push_back(asset.name);
        return fail(ErrorCode::bad_input, "lidar {}: expected a file, or one of {}", quote(name, 60),
                    fmt::join(names, ", "));
    }
    SR_TRY(const Json json, parse_json(found->json, name));
    return parse_lidar(json, name);
}

SweepPicture::SweepPicture(const Lidar& lidar)
{
    for (const LidarBeam& beam : lidar.beams) {
        shifts.push_back(int(std::lround(beam.azimuth / lidar.step())));
        rests.push_back(beam.azimuth - shifts.back() * lidar.step());
    }
    const auto [low, high] = std::ranges::minmax(shifts);
    first = low;
    width = lidar.columns + uint32_t(high - low);
}

} // namespace semrover
