// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/annotation/box_lines.h"
#include "engine/format/npy.h"
#include "engine/format/transforms.h"
#include "engine/scene/palette.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace semrover {

// A drive past boxes on a plane: what `render` leaves in a folder, of rays that are cast in double. The ground is z =
// 0: road where |y| < 4, else sidewalk.
struct DriveFolder {
    std::vector<SceneObject> objects = {
        {.id = 3, .label = 13, .center = {18, 3, 0.8}, .size = {4.4, 1.8, 1.6}, .heading = 0.1},  // a parked car
        {.id = 7, .label = 13, .center = {9, -2, 0.75}, .size = {4, 1.7, 1.5}, .heading = 0},     // one that drives on
        {.id = 12, .label = 11, .center = {14, 4.5, 0.9}, .size = {0.6, 0.6, 1.8}, .heading = 1}, // a person
        {.id = 20, .label = 2, .center = {20, 12, 5}, .size = {30, 8, 10}, .heading = -1.5},      // a house
    };
    double meters_a_moment = 0.5; // of object 7, along x
    double seconds_a_moment = 0.1;
    bool jpeg = false, lidar = false;

    // 0.4 m above the cameras, turned
    static Rigid lidar_mount() { return {0, 1, 0, 0.9, -1, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 1}; }

    static std::vector<Sensor> sensors()
    {
        return {{"front", pinhole_from_fov(80, 160, 96), mounted(0)},
                {"front_left", pinhole_from_fov(70, 128, 96), mounted(55 * std::numbers::pi / 180)}};
    }
    // 1.6 m above the vehicle's origin, level, turned to the left
    static Rigid mounted(double angle)
    {
        const double c = std::cos(angle), s = std::sin(angle);
        return compose({c, -s, 0, 1.2, s, c, 0, 0, 0, 0, 1, 1.6, 0, 0, 0, 1}, kForwardCamera);
    }

    CameraPath path(size_t moments) const
    {
        CameraPath vehicle;
        for (size_t i = 0; i < moments; ++i) {
            const double turn = 0.01 * double(i), c = std::cos(turn), s = std::sin(turn);
            const Rigid pose = {c, -s, 0, 0.4 * double(i), s, c, 0, -0.5, 0, 0, 1, 0, 0, 0, 0, 1};
            vehicle.frames.push_back(
                {2 + seconds_a_moment * double(i), "", {inverse(compose(pose, kForwardCamera))}, {}});
        }
        return *expand_rig({PathAxes::camera, sensors()}, vehicle);
    }
    std::vector<PlacedObject> placed_at(size_t moment) const
    {
        std::vector<PlacedObject> placed_objects;
        for (SceneObject o : objects) {
            if (o.id == 7)
                o.center[0] += meters_a_moment * double(moment);
            placed_objects.push_back(placed(o));
        }
        return placed_objects;
    }

    void write(const Path& folder, size_t moments) const
    {
        const CameraPath cameras = path(moments);
        DriveRecord record = drive_record_of(cameras, kMillimetre).value();
        if (lidar)
            record.lidars.push_back({"top", std::make_shared<const Lidar>(named_lidar("xt32").value()), lidar_mount()});
        std::filesystem::create_directories(folder);
        must(write_drive_record(folder, record));
        must(write_transforms(folder / "transforms.json", cameras));
        std::string boxes;
        for (size_t i = 0; i < cameras.frames.size(); ++i)
            boxes += write_pictures(folder, cameras.frames[i], record.pictures[i], i / sensors().size(), record) + "\n";
        must(write_file_atomically(folder / kBoxesName, boxes));
        if (lidar)
            write_lidar(folder / "top", record);
    }

  private:
    static void must(const Status& status) { EXPECT_TRUE(status) << status.error().message; }
    // rays 1.5 degrees apart, as far as 40 m
    void write_lidar(const Path& folder, const DriveRecord& record) const
    {
        Json sweeps = Json::array();
        std::filesystem::create_directories(folder / "points");
        for (size_t m = 0; m < record.moments.size(); ++m) {
            const Rigid to_world = compose(record.moments[m].vehicle_to_world, lidar_mount());
            std::vector<float> rows;
            for (int ring = 0; ring < 12; ++ring)
                for (int column = 0; column < 240; ++column) {
                    const double up = -0.025 * ring, turn = column * std::numbers::pi / 120;
                    const Point3 ray = {std::cos(up) * std::cos(turn), std::cos(up) * std::sin(turn), std::sin(up)};
                    const auto [far, number] = cast(to_world, ray, placed_at(m));
                    if (far < 40)
                        for (const double v :
                             {ray[0] * far, ray[1] * far, ray[2] * far, 0.5, double(ring), 0.0, 0.0, double(number)})
                            rows.push_back(float(v));
                }
            const auto bytes = std::as_bytes(std::span(rows));
            must(write_file_atomically(folder / "points" / fmt::format("{:06}.npy", m),
                                       encode_npy({DType::f32, {rows.size() / 8, 8}, {bytes.begin(), bytes.end()}})));
            sweeps.push_back(
                {{"time", record.moments[m].time}, {"duration", 100000}, {"begin", to_world}, {"end", to_world}});
        }
        must(write_file_atomically(folder / "sweeps.json",
                                   Json{{"format", "semrover.sweeps"}, {"version", 1}, {"sweeps", sweeps}}.dump()));
    }
    // metres to the first thing, and its number
    static std::pair<double, uint32_t> cast(const Rigid& to_world, const Point3& ray,
                                            std::span<const PlacedObject> there)
    {
        const Point3 from = translation_of(to_world), at = transform(to_world, ray);
        std::pair<double, uint32_t> first{at[2] < from[2] ? from[2] / (from[2] - at[2]) : INFINITY, 0};
        for (const PlacedObject& o : there)
            if (const auto met = meets(compose(inverse(to_world), o.box.pose), o.box.size, ray); met < first.first)
                first = {met, o.id + 1};
        return first;
    }
    static double meets(const Rigid& box, const std::array<double, 3>& size, const Point3& ray)
    {
        const Rigid to_box = inverse(box);
        const Point3 from = translation_of(to_box), at = transform(to_box, ray);
        double enter = 0, leave = INFINITY;
        for (size_t a = 0; a < 3; ++a) {
            const double step = at[a] - from[a], low = (-size[a] / 2 - from[a]) / step,
                         high = (size[a] / 2 - from[a]) / step;
            enter = std::max(enter, std::min(low, high));
            leave = std::min(leave, std::max(low, high));
        }
        return enter < leave ? enter : INFINITY;
    }
    std::string write_pictures(const Path& folder, const CameraFrame& frame, const DriveRecord::Picture& picture,
                               size_t moment, const DriveRecord& record) const
    {
        const Intrinsics& k = frame.intrinsics;
        const std::vector<PlacedObject> there = placed_at(moment);
        const BoxProjection projection(k, 0.2);
        const Rigid to_world = frame.pose.camera_to_world();
        const Lens lens(k);
        std::vector<double> depths;
        std::vector<uint32_t> numbers;
        std::vector<uint8_t> labels, colors;
        for (uint32_t y = 0; y < k.height; ++y)
            for (uint32_t x = 0; x < k.width; ++x) {
                const Point3 ray = *lens.ray(x + 0.5, y + 0.5), at = transform(to_world, ray),
                             from = translation_of(to_world);
                double depth = at[2] < from[2] ? from[2] / (from[2] - at[2]) * ray[2] : INFINITY;
                const double side = from[1] + (at[1] - from[1]) * depth / ray[2];
                uint8_t label = depth == INFINITY ? 10 : std::abs(side) < 4 ? 0 : 1;
                uint32_t number = 0;
                for (const PlacedObject& o : there) {
                    const auto met =
                        projection.depths({compose(frame.pose.world_to_camera, o.box.pose), o.box.size}, x, y);
                    if (met && (*met)[0] < depth) {
                        depth = (*met)[0];
                        label = o.label;
                        number = o.id + 1;
                    }
                }
                depths.push_back(depth < 65 ? depth : 0);
                numbers.push_back(number);
                labels.push_back(label);
                for (const uint8_t channel : kPalette[label].color)
                    colors.push_back(channel);
            }
        put(folder / picture.camera, picture.number, k, depths, numbers, labels, colors);
        const InstancePicture instances{k.width, k.height, numbers, [&](size_t pixel) { return depths[pixel]; }};
        const Rigid world_to_vehicle = inverse(record.moment(picture.time)->vehicle_to_world);
        return box_line(picture, seen_objects(frame, instances, there), world_to_vehicle, frame.pose.world_to_camera);
    }
    void put(const Path& folder, uint32_t number, const Intrinsics& k, std::span<const double> depths,
             std::span<const uint32_t> numbers, std::span<const uint8_t> labels, std::span<const uint8_t> colors) const
    {
        const auto file = [&](const char* kind, const char* ending) {
            std::filesystem::create_directories(folder / kind);
            return folder / kind / fmt::format("{:06}.{}", number, ending);
        };
        std::vector<uint16_t> millimetres, instances(numbers.begin(), numbers.end());
        for (const double metres : depths)
            millimetres.push_back(uint16_t(std::lround(metres * 1000)));
        must(write_png_gray16(file("depth", "png"), k.width, k.height, millimetres));
        must(write_png_gray16(file("instance", "png"), k.width, k.height, instances));
        must(write_png_gray8(file("label", "png"), k.width, k.height, labels));
        if (jpeg)
            must(write_file_atomically(file("color", "jpg"), encode_jpeg_rgb8(k.width, k.height, colors, 90).value()));
        else
            must(write_png_rgb8(file("color", "png"), k.width, k.height, colors));
    }
};

} // namespace semrover
