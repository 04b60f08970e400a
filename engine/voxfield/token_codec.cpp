// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/token_codec.h"

#include "runtime/base/dtype.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace semrover {

namespace {

using Point = std::array<float, 3>;

// order of a voxel's points in its token
std::vector<uint32_t> distance_order(const std::vector<Point>& points)
{
    std::vector<uint32_t> order(points.size());
    std::iota(order.begin(), order.end(), 0);
    const auto squared = [](const Point& p) { return double(p[0]) * p[0] + double(p[1]) * p[1] + double(p[2]) * p[2]; };
    std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const double da = squared(points[a]), db = squared(points[b]);
        return da != db ? da < db : points[a] < points[b];
    });
    return order;
}

float normalized(const TransformerConfig& c, uint32_t channel, float v)
{
    return c.normalization ? (v - c.normalization->mean[channel]) / c.normalization->std[channel] : v;
}

} // namespace

void sort_by_distance(std::span<uint16_t> points, std::span<uint8_t> colors)
{
    std::vector<Point> offsets(points.size() / 3);
    for (size_t i = 0; i < points.size(); ++i)
        offsets[i / 3][i % 3] = half_to_float(points[i]);
    const std::vector<uint16_t> old_points(points.begin(), points.end());
    const std::vector<uint8_t> old_colors(colors.begin(), colors.end());
    size_t to = 0;
    for (const uint32_t from : distance_order(offsets))
        for (size_t a = 0; a < 3; ++a, ++to) {
            points[to] = old_points[3 * from + a];
            colors[to] = old_colors[3 * from + a];
        }
}

void encode_token(const TransformerConfig& config, std::span<const uint16_t> points, std::span<const uint8_t> colors,
                  std::span<float> token)
{
    std::vector<Point> offsets(config.points_per_voxel);
    for (size_t i = 0; i < offsets.size(); ++i)
        for (size_t a = 0; a < 3; ++a)
            offsets[i][a] = half_to_float(points[3 * i + a]);
    const float half_voxel = config.voxel_size / 2;
    float* out = token.data();
    for (uint32_t i : distance_order(offsets)) {
        for (uint32_t a = 0; a < 3; ++a)
            *out++ = normalized(config, a, offsets[i][a] / half_voxel);
        for (uint32_t a = 0; a < 3; ++a)
            *out++ = normalized(config, 3 + a, 2 * float(colors[3 * i + a]) / 255 - 1);
    }
}

void unpack_points(std::span<const uint32_t> words, std::span<uint16_t> points, std::span<uint8_t> colors)
{
    for (size_t i = 0; i < words.size(); i += 3) {
        points[i] = uint16_t(words[i]);
        points[i + 1] = uint16_t(words[i] >> 16);
        points[i + 2] = uint16_t(words[i + 1]);
        for (size_t c = 0; c < 3; ++c)
            colors[i + c] = uint8_t(words[i + 2] >> 8 * c);
    }
}

} // namespace semrover
