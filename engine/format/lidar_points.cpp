// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/lidar_points.h"

#include "engine/format/npy.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace semrover {

namespace {

static_assert(std::endian::native == std::endian::little, "files are written as they are in memory");

constexpr std::string_view kPcdHeader = "# .PCD v0.7 - Point Cloud Data file format\n"
                                        "VERSION 0.7\n"
                                        "FIELDS x y z intensity ring label t instance\n"
                                        "SIZE 4 4 4 4 2 2 4 4\n"
                                        "TYPE F F F F U U U U\n"
                                        "COUNT 1 1 1 1 1 1 1 1\n"
                                        "WIDTH {0}\n"
                                        "HEIGHT 1\n"
                                        "VIEWPOINT 0 0 0 1 0 0 0\n"
                                        "POINTS {0}\n"
                                        "DATA binary\n";

void append(std::vector<std::byte>& to, std::span<const std::byte> bytes)
{
    to.insert(to.end(), bytes.begin(), bytes.end());
}

// the first `columns` of npy's
std::vector<std::byte> floats_of(std::span<const LidarPoint> points, size_t columns, float full_intensity)
{
    std::vector<std::byte> bytes;
    bytes.reserve(points.size() * columns * sizeof(float));
    for (const LidarPoint& p : points) {
        const float row[] = {p.x,
                             p.y,
                             p.z,
                             p.intensity * full_intensity,
                             float(p.ring),
                             float(p.time),
                             float(p.label),
                             float(p.instance)};
        append(bytes, std::as_bytes(std::span(row).first(columns)));
    }
    return bytes;
}

std::vector<std::byte> pcd_of(std::span<const LidarPoint> points)
{
    const std::string header = fmt::format(kPcdHeader, points.size());
    std::vector<std::byte> bytes;
    append(bytes, std::as_bytes(std::span(header)));
    for (const LidarPoint& p : points) {
        const float place[] = {p.x, p.y, p.z, p.intensity};
        const uint16_t kinds[] = {p.ring, p.label};
        const uint32_t numbers[] = {p.time, p.instance};
        append(bytes, std::as_bytes(std::span(place)));
        append(bytes, std::as_bytes(std::span(kinds)));
        append(bytes, std::as_bytes(std::span(numbers)));
    }
    return bytes;
}

} // namespace

std::vector<std::byte> encode_lidar(std::span<const LidarPoint> points, LidarFormat format)
{
    switch (format) {
    case LidarFormat::pcd:
        return pcd_of(points);
    case LidarFormat::kitti:
        return floats_of(points, 4, 1);
    case LidarFormat::nuscenes:
        return floats_of(points, 5, 255);
    case LidarFormat::npy:
        break;
    }
    return encode_npy({DType::f32, {points.size(), 8}, floats_of(points, 8, 1)});
}

} // namespace semrover
