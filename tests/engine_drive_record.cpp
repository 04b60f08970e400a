// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/drive_record.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_drive_record_test {

// along a bend, with a tilt
CameraPath forward_path(size_t moments)
{
    CameraPath path;
    for (size_t i = 0; i < moments; ++i) {
        const double a = 0.05 * double(i);
        const Rigid vehicle = *rigid_from_quaternion({10 * std::sin(a), 10 - 10 * std::cos(a), 0.3},
                                                     {0.01, 0.02, std::sin(a / 2), std::cos(a / 2)}, "vehicle");
        path.frames.push_back({1000.1 + 0.1 * double(i),
                               "",
                               {inverse(compose(vehicle, kForwardCamera))},
                               pinhole_from_fov(73, 616, 424)});
    }
    return path;
}

Rig two_cameras()
{
    Rig rig;
    Intrinsics lens = pinhole_from_fov(90, 64, 40);
    lens.model = CameraModel::opencv;
    lens.distortion = {0.04, -0.33, 1e-3, -2e-3, 0.01, 0, 0, 0};
    rig.sensors.push_back(
        {"front", lens,
         compose(*rigid_from_quaternion({1.5, 0.1, 1.6}, {0.1, -0.05, 0.02, 1}, "mount"), kForwardCamera)});
    rig.sensors.push_back(
        {"wide", fisheye_from_fov(200, 80, 80), *rigid_from_quaternion({-1, 0, 1}, {0, 0, 1, 0}, "mount")});
    return rig;
}

double largest_difference(const Rigid& a, const Rigid& b)
{
    double most = 0;
    for (size_t i = 0; i < a.size(); ++i)
        most = std::max(most, std::abs(a[i] - b[i]));
    return most;
}

TEST(engine_drive_record, comes_back_from_its_files_with_the_same_lenses_places_and_times)
{
    const ScratchFolder folder;
    Rig rig = two_cameras();
    const Rigid mount = {0, 1, 0, 0.9, -1, 0, 0, 0.1, 0, 0, 1, 2, 0, 0, 0, 1};
    rig.lidars.push_back({"top", std::make_shared<const Lidar>(*named_lidar("ot128")), mount});
    const CameraPath path = *expand_rig(rig, forward_path(7));
    const DriveRecord record = *drive_record_of(path, 0.01);
    ASSERT_TRUE(write_drive_record(folder.path(), record));
    const auto back = read_drive_record(folder.path());
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->depth_unit, 0.01);
    ASSERT_EQ(back->sensors.size(), 2u);
    for (size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(back->sensors[i].name, path.sensors[i].name);
        EXPECT_EQ(back->sensors[i].intrinsics, path.sensors[i].intrinsics);
        EXPECT_LT(largest_difference(back->sensors[i].sensor_to_vehicle, path.sensors[i].sensor_to_vehicle), 1e-15);
    }
    ASSERT_EQ(back->lidars.size(), 1u);
    EXPECT_EQ(back->lidars[0].name, "top");
    EXPECT_EQ(back->lidars[0].lidar->table, path.lidars[0].lidar->table);
    EXPECT_EQ(back->lidars[0].sensor_to_vehicle, mount);
    const CameraPath again = path_of(*back);
    ASSERT_EQ(again.frames.size(), path.frames.size());
    for (size_t i = 0; i < path.frames.size(); ++i) {
        EXPECT_EQ(again.frames[i].camera, path.frames[i].camera);
        EXPECT_EQ(again.frames[i].intrinsics, path.frames[i].intrinsics);
        EXPECT_NEAR(again.frames[i].time, path.frames[i].time, 1e-9);
        EXPECT_LT(largest_difference(again.frames[i].pose.world_to_camera, path.frames[i].pose.world_to_camera), 1e-12);
    }
    EXPECT_EQ(back->moments[3].time, 1000400000);
    EXPECT_EQ(back->pictures[7].camera, "wide");
    EXPECT_EQ(back->pictures[7].number, 3u);
    EXPECT_EQ(back->pictures[7].time, 1000400000);
    const std::string calibration = contents(folder.path() / "calibration.json");
    EXPECT_NE(calibration.find("\"along_rays\": [\n   \"wide\"\n  ]"), std::string::npos) << calibration;
}

TEST(engine_drive_record, has_the_vehicle_where_a_camera_without_a_rig_is)
{
    const ScratchFolder folder;
    const CameraPath path = forward_path(3);
    ASSERT_TRUE(write_drive_record(folder.path(), *drive_record_of(path, 0.001)));
    const auto record = read_drive_record(folder.path());
    ASSERT_TRUE(record) << record.error().message;
    ASSERT_EQ(record->sensors.size(), 1u);
    EXPECT_EQ(record->sensors[0].name, "");
    EXPECT_LT(largest_difference(record->sensors[0].sensor_to_vehicle, kForwardCamera), 1e-15);
    const Point3 ahead = transform(record->moments[0].vehicle_to_world, {1, 0, 0});
    EXPECT_NEAR(ahead[0], 1, 2e-3); // the path begins along x, with a tilt of 0.04
    EXPECT_EQ(path_of(*record).sensors.size(), 0u);
    EXPECT_EQ(contents(folder.path() / "timestamps.jsonl").substr(0, 48),
              "{\"time\":1000100000,\"camera\":\"\",\"number\":0}\n{\"tim");
}

// cameras of a path that names several, and no rig: the first one is the vehicle's
TEST(engine_drive_record, finds_where_cameras_sit_from_their_poses)
{
    const Rig rig = two_cameras();
    CameraPath path = *expand_rig(rig, forward_path(4));
    path.sensors.clear();
    const auto record = drive_record_of(path, 0.001);
    ASSERT_TRUE(record) << record.error().message;
    ASSERT_EQ(record->sensors.size(), 2u);
    const Rigid apart =
        compose(compose(kForwardCamera, inverse(rig.sensors[0].sensor_to_vehicle)), rig.sensors[1].sensor_to_vehicle);
    EXPECT_LT(largest_difference(record->sensors[1].sensor_to_vehicle, apart), 1e-12);
}

TEST(engine_drive_record, says_what_it_cannot_hold)
{
    const auto refusal = [](const CameraPath& path) {
        const auto record = drive_record_of(path, 0.001);
        return record ? std::string() : record.error().message;
    };
    CameraPath path = forward_path(3);
    path.frames[2].intrinsics.fx += 1;
    EXPECT_EQ(refusal(path), "the camera changes its lens on the way");
    path = forward_path(3);
    path.frames[2].time = path.frames[1].time;
    EXPECT_EQ(refusal(path), "times do not ascend: 1000200000 us of the camera come after 1000200000");
    path = *expand_rig(two_cameras(), forward_path(3));
    path.frames[3].pose.world_to_camera[3] += 0.01;
    EXPECT_EQ(refusal(path), "camera 'wide' changes its place on the vehicle");
}

TEST(engine_drive_record, refuses_files_that_say_something_else)
{
    const ScratchFolder folder;
    const auto refusal = [&](std::string_view file, std::string_view from, std::string_view to) {
        EXPECT_TRUE(write_drive_record(folder.path(), *drive_record_of(forward_path(3), 0.001)));
        std::string text = contents(folder.path() / file);
        const size_t at = text.find(from);
        EXPECT_NE(at, std::string::npos) << text;
        folder.put(std::string(file), text.replace(at, from.size(), to));
        const auto record = read_drive_record(folder.path());
        return record ? std::string() : record.error().message;
    };
    const auto says = [](const std::string& message, std::string_view what) {
        return message.find(what) != std::string::npos ? testing::AssertionSuccess()
                                                       : testing::AssertionFailure() << message;
    };
    EXPECT_TRUE(says(refusal("calibration.json", "\"version\": 1", "\"version\": 2"), "semrover.calibration"));
    EXPECT_TRUE(says(refusal("calibration.json", "\"unit\": 0.001", "\"unit\": 0"), "unit in metres above 0"));
    EXPECT_TRUE(says(refusal("ego_pose.jsonl", "1000200000", "1000100000"), "line 2: time: expected more than"));
    EXPECT_TRUE(says(refusal("ego_pose.jsonl", "\"position\"", "\"place\""), "place"));
    EXPECT_TRUE(says(refusal("timestamps.jsonl", "\"number\":1", "\"number\":0"), "must ascend"));
    EXPECT_TRUE(
        says(refusal("timestamps.jsonl", "\"camera\":\"\"", "\"camera\":\"x\""), "a camera of calibration.json"));
    EXPECT_TRUE(says(refusal("timestamps.jsonl", "\"number\":2}\n", "\"number\":2}"), "line 3: the line has no end"));
}

} // namespace engine_drive_record_test
} // namespace semrover
