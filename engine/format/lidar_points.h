// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace semrover {

struct LidarPoint {
    float x = 0, y = 0, z = 0; // metres
    float intensity = 0;       // 0..1
    uint16_t ring = 0, label = 0;
    uint32_t time = 0; // microseconds
    uint32_t instance = 0;
};

// What programs read, little endian:
//   npy       float32 [N, 8]: x y z intensity ring time label instance
//   pcd       PCD 0.7, binary: x y z intensity as float32, ring and label as 16 bits, t and instance as 32
//   kitti     float32 [N, 4]: x y z intensity
//   nuscenes  float32 [N, 5]: x y z intensity ring; intensity 0..255
enum class LidarFormat : uint8_t { npy, pcd, kitti, nuscenes };
constexpr std::string_view kLidarFormats[] = {"npy", "pcd", "kitti", "nuscenes"};
constexpr std::string_view kLidarEndings[] = {"npy", "pcd", "bin", "pcd.bin"};

// a lidar's folder: its poses, and files of points
constexpr const char *kSweepsName = "sweeps.json", *kSweepsFormat = "semrover.sweeps", *kSweepPoints = "points";

std::vector<std::byte> encode_lidar(std::span<const LidarPoint> points, LidarFormat format);

} // namespace semrover
