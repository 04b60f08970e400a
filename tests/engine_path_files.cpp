// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// trajectories that other programs and data sets write
#include "engine/camera/camera_view.h"
#include "engine/camera/rig.h"
#include "engine/format/image.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_path_files_test {

const Intrinsics kView = pinhole_from_fov(90, 616, 424);

// RealityScan's: names with blanks, exponents of three digits; and pictures that are numbered without zeros in front
TEST(PathFiles, colmap_names_have_blanks_and_come_in_the_order_of_their_numbers)
{
    const ScratchFolder folder;
    std::filesystem::create_directories(folder / "sparse/0");
    folder.put("sparse/0/cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
    std::string images;
    for (int i = 12; i > 0; --i)
        images += fmt::format("{} 1 0 0 8.616498381666671e-012 {} 0 0 1 map plan #{} (2).jpg\n1.5 2.5 -1\n", i, -i, i);
    folder.put("sparse/0/images.txt", images + "13 1 0 0 4e-400 0 0 0 1 map plan #010 (2).jpg \r\n\n");
    for (const char* of : {"sparse/0", "sparse", "."}) { // a project is its model
        const auto path = read_camera_path(folder / of, kView);
        ASSERT_TRUE(path) << path.error().message;
        ASSERT_EQ(path->frames.size(), 13u);
        EXPECT_EQ(path->frames[9].pose.world_to_camera[3], 0); // "#010" before "#10"
        for (size_t i = 0; i < 12; ++i)
            EXPECT_EQ(path->frames[i < 9 ? i : i + 1].pose.world_to_camera[3], -double(i + 1));
    }
    folder.put("sparse/0/images.txt", "1 1 0 0 1e400 0 0 0 1 a.jpg\n\n");
    EXPECT_TRUE(says(read_camera_path(folder / "sparse/0", kView), "expected a number, found '1e400'"));
}

TEST(PathFiles, numbers_in_names_count_as_numbers)
{
    const std::vector<std::string> sorted = {"",
                                             "1",
                                             "2",
                                             "10",
                                             "a",
                                             "a1b2",
                                             "a1b10",
                                             "a02",
                                             "a2.jpg",
                                             "a10",
                                             "a99999999999999999999999",
                                             "a100000000000000000000000",
                                             "b"};
    for (size_t i = 0; i < sorted.size(); ++i)
        for (size_t j = 0; j < sorted.size(); ++j)
            EXPECT_EQ(natural_less(sorted[i], sorted[j]), i < j) << sorted[i] << " " << sorted[j];
    EXPECT_NE(natural_less("1", "01"), natural_less("01", "1")); // an order, whatever names there are
}

// a camera at `place` that looks along the world's +x, z up: a point ahead, to the right and up
void expect_looking_along_x(const CameraPath& path, size_t frame, const Point3& place)
{
    ASSERT_GT(path.frames.size(), frame);
    const CameraFrame& f = path.frames[frame];
    const Intrinsics& k = f.intrinsics;
    const auto pixel = project(f, {place[0] + 2, place[1] - 0.5, place[2] + 0.25});
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->depth, 2, 1e-6);
    EXPECT_NEAR(pixel->x, k.cx + k.fx * 0.25, 1e-3);
    EXPECT_NEAR(pixel->y, k.cy - k.fy * 0.125, 1e-3);
}

TEST(PathFiles, pandasets_poses_are_an_array)
{
    const ScratchFolder folder;
    const auto path = read_pandaset(folder.put("poses.json", R"({"position": {}, "heading": {}})"), kView);
    EXPECT_TRUE(says(path, "expected an array of poses, found object"));
}

class DataSetPaths : public testing::Test {
  protected:
    CameraPath read(const char* name, std::string_view text)
    {
        std::filesystem::create_directories((folder / name).parent_path());
        const auto path = read_camera_path(folder.put(name, text), kView);
        EXPECT_TRUE(path) << path.error().message;
        return path.value_or(CameraPath{});
    }
    const ScratchFolder folder;
};

// by hand, from the data sets' documentation: right is -y, down is -z, forward is +x
TEST_F(DataSetPaths, of_cameras_have_their_axes_and_times)
{
    const std::string rows = "0 0 1 1\n-1 0 0 2\n0 -1 0 3\n0 0 0 1\n", line = "0 0 1 1 -1 0 0 2 0 -1 0 3 0 0 0 1\n";
    const CameraPath cam0 = read("cam0_to_world.txt", "1 " + line + "7 " + line);
    expect_looking_along_x(cam0, 1, {1, 2, 3});
    EXPECT_EQ(cam0.frames[1].time, 7);
    EXPECT_TRUE(cam0.numbered && !cam0.body);
    expect_looking_along_x(read("traj.txt", line + line), 1, {1, 2, 3});
    const CameraPath log = read("a.log", "0 0 2\n" + rows + "4 4 2\n" + rows);
    expect_looking_along_x(log, 1, {1, 2, 3});
    EXPECT_EQ(log.frames[1].time, 4);
    for (const int i : {0, 2})
        (void)folder.put(fmt::format("{}.txt", 100 + i), rows); // not in pose/
    std::filesystem::create_directory(folder / "pose");
    folder.put("pose/0.txt", rows);
    folder.put("pose/2.txt", "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n");
    folder.put("pose/10.txt", rows);
    const auto files = read_camera_path(folder / "pose", kView);
    ASSERT_TRUE(files) << files.error().message;
    ASSERT_EQ(files->frames.size(), 2u);
    expect_looking_along_x(*files, 1, {1, 2, 3});
    EXPECT_EQ(files->frames[1].time, 10);
    ASSERT_EQ(files->warnings.size(), 1u);
    EXPECT_NE(files->warnings[0].find("1 of 3 files have no pose"), std::string::npos);
    std::filesystem::create_directories(folder / "camera/front_camera");
    folder.put("camera/front_camera/intrinsics.json", R"({"fx":1970,"fy":1971,"cx":970,"cy":483})");
    folder.put("camera/front_camera/timestamps.json", "[1557539924.5]");
    const CameraPath panda = read("camera/front_camera/poses.json", R"([{"position":{"x":1,"y":2,"z":3},
        "heading":{"w":0.5,"x":-0.5,"y":0.5,"z":-0.5}}])");
    expect_looking_along_x(panda, 0, {1, 2, 3});
    EXPECT_EQ(panda.frames[0].time, 1557539924.5);
    EXPECT_EQ(panda.frames[0].intrinsics.fy, 1971);
    EXPECT_EQ(panda.frames[0].intrinsics.cx, 970.5); // counted from the centre of the first pixel in the file
    EXPECT_EQ(panda.frames[0].intrinsics.cy, 483.5);
}

TEST_F(DataSetPaths, of_vehicles_become_a_camera_that_looks_forward)
{
    // the vehicle of nuScenes: x forward, y left, z up; in the order of times
    const CameraPath ego = read("ego_pose.json", R"([
        {"token":"b","timestamp":1532402928147847,"rotation":[1,0,0,0],"translation":[4,5,6]},
        {"token":"a","timestamp":1532402927647951,"rotation":[1,0,0,0],"translation":[1,2,3]}])");
    expect_looking_along_x(ego, 0, {1, 2, 3});
    expect_looking_along_x(ego, 1, {4, 5, 6});
    EXPECT_NEAR(ego.frames[0].time, 1532402927.647951, 1e-6);
    ASSERT_TRUE(ego.body);
    EXPECT_EQ(ego.file_pose(0)[3], 1);
    EXPECT_NEAR(ego.file_pose(0)[0], 1, 1e-12); // the vehicle's own axes are the world's
    // KITTI-360's IMU: x forward, y right, z down; half a turn about x
    const CameraPath imu = read("poses.txt", "3 1 0 0 1 0 -1 0 2 0 0 -1 3\n");
    expect_looking_along_x(imu, 0, {1, 2, 3});
    EXPECT_EQ(imu.frames[0].time, 3);
    EXPECT_TRUE(imu.body);
    // EuRoC's IMU: x up, y right, z forward; w first
    const CameraPath euroc =
        read("data.csv", "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], "
                         "q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1]\n"
                         "1403636580838555648,1,2,3,0,0.7071067811865476,0,0.7071067811865476,9\n");
    expect_looking_along_x(euroc, 0, {1, 2, 3});
    EXPECT_NEAR(euroc.frames[0].time, 1403636580.838555648, 1e-6);
    // the same with w last, and seconds
    const CameraPath last = read("last.csv", "timestamp [s],p_x,p_y,p_z,q_x,q_y,q_z,q_w\n"
                                             "1.5,1,2,3,0.7071067811865476,0,0.7071067811865476,0\n");
    expect_looking_along_x(last, 0, {1, 2, 3});
    EXPECT_EQ(last.frames[0].time, 1.5);
    // PandaSet's lidar: x right, y forward, z up; a quarter turn to the right about z
    const CameraPath lidar = read("lidar/poses.json", R"([{"position":{"x":1,"y":2,"z":3},
        "heading":{"w":0.7071067811865476,"x":0,"y":0,"z":-0.7071067811865476}}])");
    expect_looking_along_x(lidar, 0, {1, 2, 3});
    EXPECT_TRUE(lidar.body);
}

// nuScenes has poses at every picture; those of the lidar's key frames are a drive
TEST_F(DataSetPaths, of_nuscenes_are_those_of_key_frames_where_the_table_is_there)
{
    folder.put("sample_data.json", R"([
        {"ego_pose_token":"a","is_key_frame":true,"filename":"samples/LIDAR_TOP/1.bin"},
        {"ego_pose_token":"b","is_key_frame":false,"filename":"sweeps/LIDAR_TOP/2.bin"},
        {"ego_pose_token":"c","is_key_frame":true,"filename":"samples/CAM_FRONT/3.jpg"},
        {"ego_pose_token":"d","is_key_frame":true,"filename":"samples/LIDAR_TOP/4.bin"}])");
    std::string poses;
    for (const char token : {'a', 'b', 'c', 'd'})
        poses += fmt::format(R"({}{{"token":"{}","timestamp":{},"rotation":[1,0,0,0],"translation":[{},0,0]}})",
                             poses.empty() ? "[" : ",", token, (token - 'a') * 4000000, token - 'a');
    const CameraPath drive = read("ego_pose.json", poses + "]");
    ASSERT_EQ(drive.frames.size(), 2u);
    EXPECT_EQ(drive.file_pose(1)[3], 3);
    ASSERT_EQ(drive.warnings.size(), 1u); // 12 s apart: two scenes
    EXPECT_NE(drive.warnings[0].find("2 poses of several scenes; after gaps of more than 5 seconds they begin anew at "
                                     "frames 0, 1"),
              std::string::npos)
        << drive.warnings[0];
}

TEST(PathFiles, broken_paths_of_data_sets_are_named)
{
    const ScratchFolder folder;
    const std::string good = "1 0 0 0 0 1 0 0 0 0 1 0";
    const auto read = [&](std::string_view text, const char* name = "a.txt") {
        return read_camera_path(folder.put(name, text), kView);
    };
    EXPECT_TRUE(says(read("1.5 " + good), "line 1: expected the number of a frame, found 1.5"));
    EXPECT_TRUE(
        says(read("1 " + good + "\n2 " + good + " 0 0 0 1\n"), "line 2: expected the 13 numbers of a frame and"));
    EXPECT_TRUE(says(read(good + " 0 0 0 1\n" + good), "line 2: expected the 16 numbers of a 4x4 matrix, found 12"));
    EXPECT_TRUE(says(read("1 0 0 0\n0 1 0 0\n0 0 1 0\n"), "the file ends within a 4x4 matrix"));
    EXPECT_TRUE(says(read("0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1\n0 0 0 1\n"), "line 4: expected the 4 numbers of a row"));
    EXPECT_TRUE(says(read("1,2,3,4,2,0,0,0\n", "a.csv"), "a.csv' line 1: expected a quaternion of norm 1"));
    EXPECT_TRUE(says(read("#t,a,b,c,d,e,f,g\n1,2,3,4,1,0,0,0\n", "a.csv"), "expected the columns timestamp, p_x"));
    EXPECT_TRUE(says(read(R"([{"position":{"x":1,"y":2},"heading":{}}])", "poses.json"), "expected heading with x"));
    EXPECT_TRUE(says(read(R"([{"timestamp":1,"rotation":[1,0,0],"translation":[1,2,3]}])", "ego_pose.json"),
                     "record 0: rotation: expected an array of 4 numbers"));
    // what is no path says what it looks like
    EXPECT_TRUE(says(read("1 2 3 4 5\n"), "is text whose first line has 5 numbers; expected a trajectory: TUM (8"));
    EXPECT_TRUE(says(read("hello world\n"), "is text that begins with 'hello world'; expected a trajectory"));
    EXPECT_TRUE(says(read(""), "is an empty file; expected"));
    EXPECT_TRUE(says(read(std::string_view("a\0b", 3)), "is a binary file of 3 bytes; expected"));
    EXPECT_TRUE(says(read(R"({"poses":[]})", "b.json"), "is JSON, an object with the keys poses; expected"));
    EXPECT_TRUE(says(read(R"([{"eye":1}])", "b.json"), "is JSON, an array of objects with the keys eye; expected"));
    EXPECT_TRUE(says(read("x", "images.txt"), "a part of a COLMAP reconstruction"));
    const ScratchFolder empty;
    EXPECT_TRUE(says(read_camera_path(empty.path(), kView), "is a folder without files; expected"));
    EXPECT_TRUE(says(read_camera_path(folder / "none", kView), "No such file"));
}

// a path whose poses are a vehicle's goes through a rig in the axes of its file, or in those of vehicles
TEST_F(DataSetPaths, carry_rigs)
{
    const CameraPath imu = read("poses.txt", "3 1 0 0 1 0 -1 0 2 0 0 -1 3\n");
    Rig rig{PathAxes::vehicle, {{"front", kView, {0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, -0.5, 0, 0, 0, 1}}}};
    expect_looking_along_x(*expand_rig(rig, imu), 0, {1, 2, 3.5}); // in the IMU's axes, up is -z
    rig = {PathAxes::camera, {{"front", kView, {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0.5, 0, 0, 0, 1}}}};
    expect_looking_along_x(*expand_rig(rig, imu), 0, {1, 2, 3.5}); // x forward, y left, z up
}

TEST(PathFiles, a_placement_applies_in_its_order)
{
    CameraPath path;
    for (const double x : {10.0, 13.0}) // looking along +x, z up
        path.frames.push_back({x, "", {inverse({0, 0, 1, x, -1, 0, 0, 20, 0, -1, 0, 30, 0, 0, 0, 1})}, kView});
    const auto placed = [&](const PathPlacement& p) {
        CameraPath moved = path;
        EXPECT_TRUE(place_path(moved, p, "a"));
        return moved;
    };
    PathPlacement p;
    p.world = {0, -1, 0, 5, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; // a quarter turn to the left, then 5 m
    p.origin = {100, 0, 0};
    EXPECT_EQ(translation_of(placed(p).frames[0].pose.camera_to_world()), (Point3{-20 + 5 + 100, 10, 30}));
    p.relative_to = PathPlacement::kFirst; // 3 m ahead of the first camera is z = 3, which the turn leaves alone
    const Point3 ahead = translation_of(placed(p).frames[1].pose.camera_to_world());
    EXPECT_NEAR(ahead[0], 105, 1e-12);
    EXPECT_NEAR(ahead[2], 3, 1e-12);
    PathPlacement lidar; // its frame at the first pose: 0.27 m behind the camera, x forward
    lidar.lidar_to_camera = {0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, -0.27, 0, 0, 0, 1};
    expect_looking_along_x(placed(lidar), 0, {0.27, 0, 0});
    expect_looking_along_x(placed(lidar), 1, {3.27, 0, 0});
    path.numbered = true;
    PathPlacement frame;
    frame.relative_to = 13;
    const Rigid own = placed(frame).frames[1].pose.world_to_camera;
    for (size_t i = 0; i < 16; ++i)
        EXPECT_NEAR(own[i], kIdentity[i], 1e-12);
    frame.relative_to = 1;
    EXPECT_TRUE(
        says(place_path(path, frame, "a"), "no frame 1, expected one of 2 frames, which the file numbers 10 to 13"));
    path.body = PathBody{"a vehicle", kIdentity};
    EXPECT_TRUE(says(place_path(path, lidar, "a"),
                     "`lidar_to_camera` brings a camera's poses into the lidar's frame, and these"));
}

// transforms.json with these keys in the file and in its frame; -W, -H and --fov-x are not given
Result<CameraPath> read_keys(const ScratchFolder& folder, const std::string& keys, const std::string& of_frame = "")
{
    const std::string pose = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]])";
    return read_camera_path(folder.put("a.json", fmt::format(R"({{{}"frames":[{{{}{}}}]}})", keys, of_frame, pose)),
                            PathLens(pinhole_from_fov(73, 616, 424), false, false));
}
const std::string kSize = R"("w":800,"h":600,)";

// what instant-ngp, nerfstudio and exporters from Blender write
TEST(PathFiles, keys_of_transforms_json_are_read)
{
    const ScratchFolder folder;
    const auto lens = [&](const std::string& keys, const std::string& of_frame = "") {
        const auto path = read_keys(folder, kSize + keys, of_frame);
        EXPECT_TRUE(path) << path.error().message;
        return path ? path->frames[0].intrinsics : Intrinsics{};
    };
    const Intrinsics fisheye = lens(R"("is_fisheye":true,"fl_x":400,"k1":0.02,"k2":0.001,"k3":0,"k4":0,)");
    EXPECT_EQ(fisheye.model, CameraModel::fisheye);
    EXPECT_EQ(fisheye.distortion[1], 0.001);
    EXPECT_EQ(lens(R"("is_fisheye":false,"fl_x":400,"k1":0.02,)").model, CameraModel::opencv);
    EXPECT_NEAR(lens(R"("camera_angle_x":1.2,"camera_angle_y":0.5,)").fx, 584.678, 1e-3); // 400 / tan 0.6
    EXPECT_NEAR(lens(R"("camera_angle_x":1.2,"camera_angle_y":0.5,)").fy, 1174.895, 1e-3);
    EXPECT_NEAR(lens(R"("camera_angle_y":0.5,)").fx, 1174.895, 1e-3);
    EXPECT_NEAR(lens(R"("x_fov":60,"y_fov":40,)").fy, 824.243, 1e-3);                  // 300 / tan 20 degrees
    EXPECT_NEAR(lens(R"("fl_x":500,)", R"("camera_angle_x":1.2,)").fx, 584.678, 1e-3); // the frame's own
    EXPECT_NEAR(lens(R"("is_fisheye":1,"camera_angle_x":1.2,)").fx, 584.678, 1e-3);    // as both programs do
    for (const auto& [model, k2] : {std::pair{"SIMPLE_RADIAL_FISHEYE", 0.0}, {"RADIAL_FISHEYE", 0.003}}) {
        const Intrinsics k = lens(fmt::format(R"("camera_model":"{}","fl_x":9,"k1":0.02,"k2":{},)", model, k2));
        EXPECT_EQ(k.model, CameraModel::fisheye);
        EXPECT_EQ(k.distortion[1], k2);
    }
    lens(R"("fl_x":400,"rolling_shutter":[0,0,0,0],"aabb_scale":16,"scale":0.33,"offset":[0,0,1],)");
    const auto applied = read_keys(folder, kSize + R"("fl_x":4,"applied_transform":[[1,0,0,0],[0,0,1,0],[0,-1,0,0]],)");
    ASSERT_TRUE(applied);
    ASSERT_EQ(applied->warnings.size(), 1u);
    EXPECT_NE(applied->warnings[0].find("applied_transform"), std::string::npos);
    EXPECT_EQ(applied->frames[0].pose.world_to_camera, inverse(kFlipYZ));
}

TEST(PathFiles, keys_of_transforms_json_that_are_not_read_are_refused_by_name)
{
    const ScratchFolder folder;
    const auto refused = [&](const std::string& keys, std::string_view text, const std::string& of_frame = "") {
        return says(read_keys(folder, keys, of_frame), text);
    };
    EXPECT_TRUE(refused(kSize + R"("is_fisheye":true,"camera_model":"OPENCV","fl_x":4,)", "is_fisheye, and camera_m"));
    EXPECT_TRUE(refused(kSize + R"("is_fisheye":"yes","fl_x":4,)", "is_fisheye: expected true or false"));
    EXPECT_TRUE(refused(kSize + R"("camera_model":"FISHEYE624","fl_x":4,)", "camera_model 'FISHEYE624' is not"));
    EXPECT_TRUE(refused(kSize + R"("fl_x":4,"ftheta_p0":1,)", "ftheta_p0 is not supported"));
    EXPECT_TRUE(refused(kSize + R"("fl_x":4,"latlong":true,)", "latlong is not supported"));
    EXPECT_TRUE(
        refused(kSize + R"("fl_x":4,)", "a rolling shutter is three keys", R"("rolling_shutter":[0,0,0.1,0],)"));
    EXPECT_TRUE(refused(kSize, "intrinsic_matrix is not", R"("intrinsic_matrix":[[4,0,2],[0,4,2],[0,0,1]],)"));
    EXPECT_TRUE(refused(kSize + R"("camera_angle_x":3.2,)", "a field of view of 3.2 radians along x"));
    EXPECT_TRUE(refused(R"("w":800,"fl_x":4,)", "h is missing beside w"));
}

TEST(PathFiles, a_transforms_file_without_a_size_takes_that_of_its_pictures)
{
    const ScratchFolder folder;
    const std::string angle = R"("camera_angle_x":1.2,)", picture = R"("file_path":"./train/r_0",)";
    const auto taken = read_keys(folder, angle, picture); // no picture: it is said
    ASSERT_TRUE(taken) << taken.error().message;
    EXPECT_EQ(taken->frames[0].intrinsics.width, 616u);
    ASSERT_EQ(taken->warnings.size(), 1u);
    EXPECT_NE(taken->warnings[0].find("the default of 616 x 424 is taken (`width`, `height`)"), std::string::npos);
    EXPECT_TRUE(says(read_keys(folder, R"("fl_x":555,)", picture), "no image size (w, h), and no picture to take it"));
    EXPECT_EQ(read_keys(folder, "", picture)->warnings.size(), 2u); // size and field of view
    std::filesystem::create_directory(folder / "train");
    ASSERT_TRUE(write_png_rgb8(folder / "train/r_0.png", 40, 30, std::vector<uint8_t>(40 * 30 * 3)));
    const auto own = read_keys(folder, angle, picture);
    ASSERT_TRUE(own);
    EXPECT_EQ(own->frames[0].intrinsics.height, 30u);
    EXPECT_NEAR(own->frames[0].intrinsics.fx, 20 / std::tan(0.6), 1e-9);
    EXPECT_TRUE(own->warnings.empty());
    EXPECT_EQ(read_camera_path(folder / "a.json", pinhole_from_fov(73, 80, 60))->frames[0].intrinsics.width, 80u);
}

TEST(PathFiles, a_default_field_of_view_is_said)
{
    const ScratchFolder folder;
    const Path path = folder.put("a.tum", "0 0 0 0 0 0 0 1\n");
    const auto read = read_camera_path(path, PathLens(pinhole_from_fov(73, 616, 424), false, false));
    ASSERT_EQ(read->warnings.size(), 1u);
    EXPECT_NE(read->warnings[0].find("has no intrinsics; the default field of view of 73 degrees is taken (`fov_x`)"),
              std::string::npos);
    EXPECT_TRUE(read_camera_path(path, kView)->warnings.empty());
}

} // namespace engine_path_files_test
} // namespace semrover
