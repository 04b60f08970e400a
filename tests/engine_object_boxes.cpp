// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/dataset/object_boxes.h"

#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace semrover {
namespace engine_object_boxes_test {

constexpr double kPi = std::numbers::pi;
constexpr uint8_t kSign = 7, kPerson = 11, kRider = 12, kCar = 13, kTruck = 14, kTram = 16, kBicycle = 18;

class ObjectBoxes : public testing::Test {
  protected:
    Result<BoxFile> read(BoxFormat format, const std::string& name, const std::string& text,
                         const BoxOptions& options = {}) const
    {
        return read_box_file(folder_.put(name, text), format, options);
    }
    Result<BoxFile> kitti(const std::string& text, const BoxOptions& options = {}) const
    {
        return read(BoxFormat::kitti, "000001.txt", text, options);
    }
    Result<BoxFile> waymo(const std::string& text, const BoxOptions& options = {}) const
    {
        return read(BoxFormat::waymo, "frame.json", text, options);
    }
    Result<BoxFile> table(const std::string& text, const BoxOptions& options = {}) const
    {
        return read(BoxFormat::waymo, "boxes.csv", text, options);
    }
    Result<BoxFile> carla(const std::string& text, const BoxOptions& options = {}) const
    {
        return read(BoxFormat::carla, "boxes.json", text, options);
    }

    ScratchFolder folder_;
};

void expect_box(const SceneObject& o, uint8_t label, const Point3& center, const Point3& size, double heading,
                double tolerance = 1e-9)
{
    EXPECT_EQ(o.label, label);
    for (size_t a = 0; a < 3; ++a) {
        EXPECT_NEAR(o.center[a], center[a], tolerance) << a;
        EXPECT_NEAR(o.size[a], size[a], 1e-9) << a;
    }
    EXPECT_NEAR(std::remainder(o.heading - heading, 2 * kPi), 0, tolerance);
}

// type truncated occluded alpha, box in the picture, h w l, x y z, rotation_y
const std::string kAhead = "Car 0.00 0 -1.58 587.01 173.33 614.12 200.12 1.6 1.8 4.2 -2.5 1.7 20 -1.5707963267948966\n";
const std::string kAcross = "Pedestrian 0 1 0.2 1 2 3 4 1.8 0.6 0.9 3 1.5 8 0\n";
const std::string kDontCare = "DontCare -1 -1 -10 5 6 7 8 -1 -1 -1 -1000 -1000 -1000 -10\n";

// docs/formats.md §3.1. A camera sees x to the right, y down, z ahead. -2.5 to the right is 2.5 to the left; the bottom
// lies 1.7 below, so the middle of 1.6 lies 0.9 below.
TEST_F(ObjectBoxes, kitti_boxes_stand_on_their_place_and_look_along_the_street)
{
    const auto file = kitti(kAhead + "\n" + kAcross + kDontCare);
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ(file->objects.size(), 2u);
    expect_box(file->objects[0], kCar, {20, 2.5, -0.9}, {4.2, 1.8, 1.6}, 0);
    expect_box(file->objects[1], kPerson, {8, -3, -0.6}, {0.9, 0.6, 1.8}, -kPi / 2); // to the right
    EXPECT_EQ(file->objects[1].id, 1u);
    EXPECT_EQ(file->dropped, 1u);
    ASSERT_EQ(file->warnings.size(), 1u);
    EXPECT_NE(file->warnings[0].find("1 objects of label 8 (DontCare) are left out"), std::string::npos);
}

// by the corners that the devkit's readme gives: (l/2, 0, w/2) turned by rotation_y, and -h for the upper ones
TEST_F(ObjectBoxes, kitti_corners_are_those_of_the_readme)
{
    const double h = 1.5, w = 1.7, l = 3.9, x = 4, y = 1.6, z = 12, turn = 0.7;
    const auto file = kitti(fmt::format("Van 0 0 0 0 0 0 0 {} {} {} {} {} {} {}\n", h, w, l, x, y, z, turn));
    ASSERT_TRUE(file) << file.error().message;
    const SceneObject& o = file->objects.at(0);
    for (const auto& [along, across, up] :
         {Point3{l / 2, w / 2, 0}, {l / 2, -w / 2, 0}, {-l / 2, w / 2, -h}, {-l / 2, -w / 2, -h}}) {
        const double camera_x = std::cos(turn) * along + std::sin(turn) * across + x, camera_y = up + y;
        const double camera_z = -std::sin(turn) * along + std::cos(turn) * across + z;
        const double dx = camera_z - o.center[0], dy = -camera_x - o.center[1], dz = -camera_y - o.center[2];
        const double c = std::cos(o.heading), s = std::sin(o.heading);
        EXPECT_NEAR(c * dx + s * dy, along, 1e-9);
        EXPECT_NEAR(c * dy - s * dx, across, 1e-9);
        EXPECT_NEAR(dz, -up - h / 2, 1e-9);
    }
}

// the lidar of the calibration looks along the camera's z, stands 0.3 behind it and 0.1 above
TEST_F(ObjectBoxes, kitti_calibration_brings_boxes_into_the_lidars_frame)
{
    const std::string matrix = " 0 -1 0 0  0 0 -1 -0.1  1 0 0 -0.3\n", rectify = " 1 0 0 0 1 0 0 0 1\n";
    for (const std::string& text : {"P0: 1 2 3\nR0_rect:" + rectify + "Tr_velo_to_cam:" + matrix,
                                    "R_rect" + rectify + "Tr_velo_cam" + matrix + "Tr_imu_velo 1\n"}) {
        const auto file = kitti(kAhead, {.calibration = folder_.put("calib.txt", text)});
        ASSERT_TRUE(file) << file.error().message;
        expect_box(file->objects.at(0), kCar, {20.3, 2.5, -1.0}, {4.2, 1.8, 1.6}, 0);
    }
    // rectified by a turn of 0.1 about y: the camera's z becomes (-sin, 0, cos) of the unrectified camera
    const double c = std::cos(0.1), s = std::sin(0.1);
    const std::string turned = fmt::format("R0_rect: {} 0 {} 0 1 0 {} 0 {}\nTr_velo_to_cam:{}", c, s, -s, c, matrix);
    const auto file = kitti(kAhead, {.calibration = folder_.put("calib.txt", turned)});
    ASSERT_TRUE(file) << file.error().message;
    expect_box(file->objects.at(0), kCar, {20 * c - 2.5 * s + 0.3, 2.5 * c + 20 * s, -1.0}, {4.2, 1.8, 1.6}, 0.1);
    const auto with = [&](const std::string& text) {
        return kitti(kAhead, {.calibration = folder_.put("calib.txt", text)});
    };
    EXPECT_TRUE(says(with("R0_rect:" + rectify), "expected lines R0_rect: and Tr_velo_to_cam:"));
    EXPECT_TRUE(says(with("R0_rect: 1 2 3\n"), "calib.txt' line 1: expected 9 numbers, found 3"));
    EXPECT_TRUE(says(with("R0_rect: 2 0 0 0 2 0 0 0 2\n"), "expected a rotation"));
    EXPECT_TRUE(says(with("R0_rect: 1 0 0 0 x 0 0 0 1\n"), "expected a number, found 'x'"));
    EXPECT_TRUE(says(kitti(kAhead, {.calibration = folder_ / "none.txt"}), "none.txt"));
}

TEST_F(ObjectBoxes, kitti_tracking_has_many_frames_and_keeps_the_ids)
{
    const std::string tracks = "0 7 " + kAhead + "0 -1 " + kDontCare + "3 7 " + kAcross + "3 9 " + kAhead;
    const auto file = kitti(tracks, {.frame = 3});
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ(file->objects.size(), 2u);
    EXPECT_EQ(file->objects[0].id, 7u);
    EXPECT_EQ(file->objects[0].label, kPerson);
    EXPECT_EQ(file->objects[1].id, 9u);
    EXPECT_TRUE(kitti(tracks, {.frame = 2})->objects.empty());
    EXPECT_TRUE(says(kitti(tracks, {.frame = 4}), "there is no frame 4, the last is 3"));
    EXPECT_TRUE(says(kitti(tracks), "000001.txt' line 3: frame 3 after frame 0: choose one with `frame`"));
    EXPECT_TRUE(says(kitti(kAhead, {.frame = 0}), "`frame` is for labels of tracking"));
    EXPECT_TRUE(says(kitti("0 7 " + kAhead + "0 7 " + kAhead), "line 2: id 7 is given twice"));
    EXPECT_TRUE(says(kitti("0 1.5 " + kAhead), "track id: expected a whole number, found 1.5"));
}

TEST_F(ObjectBoxes, broken_kitti_labels_are_refused_with_their_line)
{
    std::string score = kAhead;
    score.replace(score.find('\n'), 1, " 0.87\n");
    EXPECT_EQ(kitti(score)->objects.size(), 1u);
    EXPECT_EQ(kitti("\xef\xbb\xbf" + kAhead)->objects.size(), 1u);
    EXPECT_TRUE(kitti("")->objects.empty());
    EXPECT_TRUE(says(kitti(kAhead + "Car 1 2\n"), "000001.txt' line 2: expected 15 words of a label"));
    EXPECT_TRUE(says(kitti(kAhead + kAhead.substr(0, 60) + "\n"), "line 2"));
    std::string text = kAhead;
    text.replace(text.find("4.2"), 3, "0.0");
    EXPECT_TRUE(says(kitti(text), "line 1: size: expected numbers from 0.001 to 10000, found 0"));
    text.replace(text.find("0.0 -2.5"), 3, "nan");
    EXPECT_TRUE(says(kitti(text), "line 1: a number that is not finite"));
    text.replace(text.find("nan"), 3, "4,2");
    EXPECT_TRUE(says(kitti(text), "line 1: expected a number, found '4,2'"));
    text = kAhead;
    text.replace(text.find("20 "), 3, "2e7 ");
    EXPECT_TRUE(says(kitti(text), "center: expected numbers from -1000000 to 1000000"));
    text.replace(0, 3, "Cow");
    EXPECT_TRUE(says(kitti(kAhead + text), "unknown labels: 1009 Cow (1 objects); `map` says what they are"));
    const Path map = folder_.put("map.json", R"({"Cow": null, "Misc": "truck", "Car": "road-lane"})");
    const auto mapped = kitti(kAhead + "Misc" + kAhead.substr(3) + text, {.map = map});
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(mapped->objects.at(0).label, 19);
    EXPECT_EQ(mapped->objects.at(1).label, kTruck);
    EXPECT_EQ(mapped->dropped, 1u);
    EXPECT_TRUE(says(kitti(kAhead, {.map = folder_.put("map.json", R"({"Car": "cart"})")}), "expected a class"));
    EXPECT_TRUE(says(kitti(kAhead, {.sample = "t"}), "`sample` has no meaning for kitti-boxes"));
}

class NuscenesBoxes : public ObjectBoxes {
  protected:
    NuscenesBoxes()
    {
        folder_.put("instance.json", R"([{"token": "i1", "category_token": "c1", "nbr_annotations": 2},
            {"token": "i2", "category_token": "c2"}, {"token": "i3", "category_token": "c3"},
            {"token": "other", "category_token": "none"}])");
        folder_.put("category.json", R"([{"token": "c1", "name": "vehicle.car"},
            {"token": "c2", "name": "human.pedestrian.adult"}, {"token": "c3", "name": "animal"}])");
    }
    static std::string annotation(const std::string& instance, const std::string& sample, const std::string& place,
                                  int points, const std::string& rotation = "[1, 0, 0, 0]")
    {
        return fmt::format(R"({{"token": "a", "sample_token": "{}", "instance_token": "{}", "attribute_tokens": [],
            "translation": {}, "size": [1.9, 4.5, 1.6], "rotation": {}, "num_lidar_pts": {}}})",
                           sample, instance, place, rotation, points);
    }
    Result<BoxFile> boxes(const std::string& records, const BoxOptions& options = {}) const
    {
        return read(BoxFormat::nuscenes, "sample_annotation.json", "[" + records + "]", options);
    }

    // a quarter turn from x towards y, w first
    const std::string quarter_ = "[0.7071067811865476, 0, 0, 0.7071067811865476]";
    const std::string records_ =
        annotation("i1", "s1", "[400, 1100, 1]", 3) + "," + annotation("i1", "s2", "[405, 1100, 1]", 9, quarter_) +
        "," + annotation("i2", "s2", "[410, 1200, 1]", 1) + "," + annotation("i3", "s2", "[411, 1200, 1]", 1);
};

TEST_F(NuscenesBoxes, a_sample_is_chosen_or_each_instance_where_the_lidar_sees_it_best)
{
    const auto all = boxes(records_);
    ASSERT_TRUE(all) << all.error().message;
    ASSERT_EQ(all->objects.size(), 2u);
    expect_box(all->objects[0], kCar, {405, 1100, 1}, {4.5, 1.9, 1.6}, kPi / 2); // size: width first
    expect_box(all->objects[1], kPerson, {410, 1200, 1}, {4.5, 1.9, 1.6}, 0);
    EXPECT_EQ(all->dropped, 1u);
    const auto first = boxes(records_, {.origin = {-400, -1000, 0}, .sample = "s1"});
    ASSERT_TRUE(first) << first.error().message;
    ASSERT_EQ(first->objects.size(), 1u);
    expect_box(first->objects[0], kCar, {0, 100, 1}, {4.5, 1.9, 1.6}, 0);
    EXPECT_TRUE(says(boxes(records_, {.sample = "s3"}), "no annotation of the sample 's3'"));
}

// the vehicle stands at (405, 1090) and looks along y: the car lies 10 ahead, and looks ahead too
TEST_F(NuscenesBoxes, boxes_come_into_the_vehicles_frame)
{
    folder_.put("sample_data.json", R"([
        {"token": "d0", "sample_token": "s2", "ego_pose_token": "p0", "is_key_frame": false, "filename": "LIDAR_TOP/0"},
        {"token": "d1", "sample_token": "s2", "ego_pose_token": "p0", "is_key_frame": true, "filename": "CAM_FRONT/1"},
        {"token": "d2", "sample_token": "s2", "ego_pose_token": "p2", "is_key_frame": true,
         "filename": "samples/LIDAR_TOP/n__LIDAR_TOP__1.pcd.bin"}])");
    folder_.put("ego_pose.json", R"([{"token": "p0", "translation": [0, 0, 0], "rotation": [1, 0, 0, 0]},
        {"token": "p2", "translation": [405, 1090, 0], "rotation": )" +
                                     quarter_ + "}]");
    const auto file = boxes(records_, {.sample = "s2", .vehicle_frame = true});
    ASSERT_TRUE(file) << file.error().message;
    expect_box(file->objects.at(0), kCar, {10, 0, 1}, {4.5, 1.9, 1.6}, 0);
    expect_box(file->objects.at(1), kPerson, {110, -5, 1}, {4.5, 1.9, 1.6}, -kPi / 2);
    EXPECT_TRUE(says(boxes(records_, {.vehicle_frame = true}), "`vehicle_frame` needs `sample`"));
    EXPECT_TRUE(says(boxes(records_, {.sample = "s1", .vehicle_frame = true}), "no key frame of LIDAR_TOP"));
}

TEST_F(NuscenesBoxes, broken_tables_are_refused_with_their_record)
{
    EXPECT_TRUE(says(boxes("7"), "sample_annotation.json' record 0: expected an object, found number"));
    EXPECT_TRUE(says(boxes("{}"), "record 0: sample_token: expected a string"));
    EXPECT_TRUE(says(boxes(records_ + "," + annotation("i1", "s", "[1, 2]", 99)),
                     "record 4: translation: expected an array of 3 numbers"));
    EXPECT_TRUE(says(boxes(annotation("i1", "s", "[1, 2, 3]", 0, "[0, 0, 0, 0]")), "record 0: expected a quaternion"));
    EXPECT_TRUE(says(boxes(annotation("i9", "s", "[1, 2, 3]", 0)), "instance.json': no record with the token 'i9'"));
    EXPECT_TRUE(says(boxes(records_ + "," + annotation("i2", "s2", "[1, 2, 3]", 0), {.sample = "s2"}),
                     "record 4: instance 'i2' is annotated twice in the sample"));
    EXPECT_TRUE(says(read(BoxFormat::nuscenes, "sample_annotation.json", "{}"), "expected an array"));
    EXPECT_TRUE(says(read(BoxFormat::nuscenes, "sample_annotation.json", "[{\"a\": 1,"), "not valid JSON"));
    EXPECT_TRUE(says(boxes(std::string(40, '[') + std::string(40, ']')), "value 0: nested deeper than 8"));
    folder_.put("instance.json", "[{\"token\": \"i1\", \"category_token\": \"c7\"}]");
    EXPECT_TRUE(says(boxes(annotation("i1", "s", "[1, 2, 3]", 0)), "category.json': no record with the token 'c7'"));
    std::filesystem::remove(folder_ / "instance.json");
    EXPECT_TRUE(says(boxes(records_), "instance.json"));
}

// of the vehicle: 10 ahead, 2 to the left
const std::string kWaymoLabels = R"([{"box": {"centerX": 10, "centerY": 2, "centerZ": 0.8, "length": 4.4, "width": 1.9,
    "height": 1.5, "heading": 0.25}, "type": "TYPE_VEHICLE", "id": "a-b", "metadata": {"speedX": 0}},
    {"box": {"center_x": 5, "length": 0.7, "width": 0.7, "height": 1.7}, "type": 4},
    {"box": {"center_x": 5, "length": 0.7, "width": 0.7, "height": 1.7}}])";

TEST_F(ObjectBoxes, waymo_labels_are_of_the_vehicle_or_by_its_pose_of_the_world)
{
    const auto file = waymo(kWaymoLabels);
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ(file->objects.size(), 2u);
    expect_box(file->objects[0], kCar, {10, 2, 0.8}, {4.4, 1.9, 1.5}, 0.25);
    expect_box(file->objects[1], kRider, {5, 0, 0}, {0.7, 0.7, 1.7}, 0); // what is left out is 0
    EXPECT_EQ(file->dropped, 1u);                                        // of no type
    const std::string frame = R"({"timestampMicros": "1553735853462203", "laserLabels": )" + kWaymoLabels +
                              R"(, "pose": {"transform": [0, -1, 0, 100, 1, 0, 0, 200, 0, 0, 1, 5, 0, 0, 0, 1]}})";
    const auto world = waymo(frame);
    ASSERT_TRUE(world) << world.error().message;
    expect_box(world->objects[0], kCar, {98, 210, 5.8}, {4.4, 1.9, 1.5}, 0.25 + kPi / 2);
    const auto vehicle = waymo(frame, {.vehicle_frame = true});
    ASSERT_TRUE(vehicle) << vehicle.error().message;
    expect_box(vehicle->objects[0], kCar, {10, 2, 0.8}, {4.4, 1.9, 1.5}, 0.25);
}

TEST_F(ObjectBoxes, broken_waymo_labels_are_refused_with_their_number)
{
    EXPECT_TRUE(says(waymo("{}"), "expected an array of labels, or an object with one as laserLabels"));
    EXPECT_TRUE(says(waymo("[{}]"), "frame.json' label 0: expected an object with a box"));
    EXPECT_TRUE(says(waymo("[3]"), "label 0: expected an object with a box"));
    EXPECT_TRUE(
        says(waymo(R"([{"box": {"centerX": "7"}}])"), "label 0: box: centerX: expected a number, found string"));
    EXPECT_TRUE(says(waymo(R"([{"box": {"length": 1, "width": 1}, "type": 1}])"), "label 0: size: expected numbers"));
    EXPECT_TRUE(says(waymo(R"([{"box": {}, "type": 9}])"), "unknown labels: 1005 type 9 (1 objects)"));
    EXPECT_TRUE(
        says(waymo(R"({"laserLabels": [], "pose": {"transform": [1, 2]}})"), "pose: transform: expected a 4x4"));
    EXPECT_TRUE(says(waymo(R"({"laserLabels": [], "pose": {}})"), "pose: transform: expected 16 numbers"));
    EXPECT_TRUE(says(waymo("[]", {.frame = 1}), "`frame` is for tables"));
}

const std::string kWaymoHeader =
    ",key.segment_context_name,key.frame_timestamp_micros,key.laser_object_id,[LiDARBoxComponent].box.center.x,"
    "[LiDARBoxComponent].box.center.y,[LiDARBoxComponent].box.center.z,[LiDARBoxComponent].box.size.x,"
    "[LiDARBoxComponent].box.size.y,[LiDARBoxComponent].box.size.z,[LiDARBoxComponent].box.heading,"
    "[LiDARBoxComponent].type,[LiDARBoxComponent].speed.x\r\n";

TEST_F(ObjectBoxes, waymo_tables_hold_frames_of_which_one_is_chosen)
{
    const std::string rows =
        "0,seg,1500,a,10,2,0.8,4.4,1.9,1.5,0.25,1,\r\n\r\n1,seg,1500,\"b\",1,2,3,0.1,0.8,0.9,-3,3,\n"
        "2,seg,1600,a,11,2,0.8,4.4,1.9,1.5,0.25,1,\n";
    const auto file = table(kWaymoHeader + rows, {.frame = 1500});
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ(file->objects.size(), 2u);
    expect_box(file->objects[0], kCar, {10, 2, 0.8}, {4.4, 1.9, 1.5}, 0.25);
    expect_box(file->objects[1], kSign, {1, 2, 3}, {0.1, 0.8, 0.9}, -3);
    EXPECT_TRUE(says(table(kWaymoHeader + rows), "boxes.csv' line 5: frame 1600 after frame 1500: choose one"));
    EXPECT_TRUE(says(table(kWaymoHeader + rows, {.frame = 1}), "there is no frame 1"));
    EXPECT_TRUE(says(table(""), "expected a line with the names of columns, found nothing"));
    EXPECT_TRUE(says(table("a,b\n"), "there is no column [LiDARBoxComponent].box.center.x"));
    EXPECT_TRUE(says(table("a,b,a\n"), "column 'a' is given twice"));
    EXPECT_TRUE(says(table(kWaymoHeader + "1,2\n"), "line 2: expected 13 values, found 2"));
    EXPECT_TRUE(says(table(kWaymoHeader + "1,\"2,3\"\n"), "line 2: a value with a quote or a comma inside"));
    EXPECT_TRUE(says(table(kWaymoHeader + "0,s,-1,a,1,2,3,4,5,6,7,1,\n"), "line 2: expected a timestamp"));
    EXPECT_TRUE(says(table(kWaymoHeader + "0,s,1,a,1,2,inf,4,5,6,7,1,\n"), "line 2: a number that is not finite"));
    EXPECT_TRUE(says(table(kWaymoHeader + "0,s,1,a,1,2,,4,5,6,7,1,\n"), "line 2: expected a number, found ''"));
    EXPECT_TRUE(
        says(table(kWaymoHeader + "0,s,1,a,1,2,3,4,5,6,7,1,\n0,t,1,a,1,2,3,4,5,6,7,1,\n"), "line 3: another segment"));
}

const std::string kPlace = R"("location": {"x": 10, "y": 3, "z": 0.8}, "extent": {"x": 2.2, "y": 0.9, "z": 0.75},
    "rotation": {"pitch": 0, "yaw": 90, "roll": 0})";

// y to the right becomes -y; a yaw of 90 degrees looks along CARLA's y, to the right
TEST_F(ObjectBoxes, carla_is_left_handed_and_gives_half_sizes)
{
    const auto file = carla(R"([{"id": 31, "type_id": "vehicle.tesla.model3", "color": "255,51,0", )" + kPlace +
                            R"(}, {"id": 7, "tags": [12], "location": [1, -2, 1], "rotation": [3, -30, 2],
                            "extent": [0.2, 0.3, 0.9], "attributes": {"color": null, "speed": "1.4"}}])");
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ(file->objects.size(), 2u);
    expect_box(file->objects[0], kCar, {10, -3, 0.8}, {4.4, 1.8, 1.5}, -kPi / 2);
    EXPECT_EQ(file->objects[0].id, 31u);
    EXPECT_EQ(file->objects[0].tint, (std::array<double, 3>{1, 0.2, 0}));
    expect_box(file->objects[1], kPerson, {1, 2, 1}, {0.4, 0.6, 1.8}, kPi / 6);
    EXPECT_FALSE(file->objects[1].tint);
}

// An actor at (100, 50, 2) that looks along CARLA's y and climbs by 10 degrees. Its box's middle lies 1 ahead and 0.7
// up along the actor's axes: ahead is (0, cos, sin), up is (0, -sin, cos).
TEST_F(ObjectBoxes, carla_boxes_of_an_actor_move_with_its_transform)
{
    const auto file = carla(R"([{"type": "Truck", "location": [1, 0, 0.7], "rotation": [0, 0, 0], "extent": [4, 1, 1.5],
        "transform": {"location": [100, 50, 2], "rotation": [10, 90, 0]}}])");
    ASSERT_TRUE(file) << file.error().message;
    const double c = std::cos(kPi / 18), s = std::sin(kPi / 18);
    expect_box(file->objects.at(0), kTruck, {100, -(50 + c - 0.7 * s), 2 + s + 0.7 * c}, {8, 2, 3}, -kPi / 2);
    // roll lowers the right side: a middle 1 to the right of an actor that is rolled by 30 degrees lies 0.5 lower
    const auto rolled = carla(R"([{"type": "Car", "location": [0, 1, 0], "rotation": [0, 0, 0], "extent": [2, 1, 1],
        "transform": {"location": [0, 0, 0], "rotation": [0, 0, 30]}}])");
    expect_box(rolled->objects.at(0), kCar, {0, -std::sqrt(0.75), -0.5}, {4, 2, 2}, 0);
    // one that looks along CARLA's y has -x to its right; rolled by 30 degrees, right is (-cos, 0, -sin) and up is
    // (-sin, 0, cos)
    const auto turned = carla(R"([{"type": "Car", "location": [0, 1, 2], "rotation": [0, 0, 0], "extent": [2, 1, 1],
        "transform": {"location": [0, 0, 0], "rotation": [0, 90, 30]}}])");
    expect_box(turned->objects.at(0), kCar, {-std::sqrt(0.75) - 1, 0, std::sqrt(3) - 0.5}, {4, 2, 2}, -kPi / 2);
    // rolled by 30 degrees, right is (0, cos, -sin); climbing by 30, up becomes (-sin, 0, cos): right is (1/4, cos,
    // ...)
    const auto climbing = carla(R"([{"type": "Car", "location": [0, 1, 0], "rotation": [30, 0, 30],
        "extent": [2, 1, 1], "transform": {"location": [0, 0, 0], "rotation": [0, 0, 0]}}, {"type": "Car",
        "location": [0, 1, 0], "rotation": [0, 0, 0], "extent": [2, 1, 1],
        "transform": {"location": [0, 0, 0], "rotation": [30, 0, 30]}}])");
    expect_box(climbing->objects.at(0), kCar, {0, -1, 0}, {4, 2, 2}, 0);
    expect_box(climbing->objects.at(1), kCar, {0.25, -std::sqrt(0.75), -std::sqrt(0.1875)}, {4, 2, 2}, 0);
    const auto lying =
        carla(R"([{"type": "Car", "location": [0, 1, 0], "rotation": [0, 0, 80], "extent": [2, 1, 1]}])");
    ASSERT_TRUE(lying) << lying.error().message;
    EXPECT_TRUE(lying->objects.empty());
    EXPECT_EQ(lying->dropped, 1u);
    EXPECT_EQ(lying->warnings.at(0), "1 objects that are tilted by more than 45 degrees are left out");
}

TEST_F(ObjectBoxes, carla_classes_come_from_names_tags_base_types_and_blueprints)
{
    const auto label = [&](const std::string& fields) {
        const auto file = carla("[{" + fields + ", " + kPlace + "}]");
        EXPECT_TRUE(file) << file.error().message;
        return file && !file->objects.empty() ? int(file->objects[0].label) : -1;
    };
    EXPECT_EQ(label(R"("class": "traffic sign")"), kSign);
    EXPECT_EQ(label(R"("type": "TrafficSigns")"), kSign);
    EXPECT_EQ(label(R"("tags": [17, 5])"), kTram);
    EXPECT_EQ(label(R"("base_type": "van", "type_id": "vehicle.x.y")"), kCar);
    EXPECT_EQ(label(R"("attributes": {"base_type": "bicycle"}, "type_id": "vehicle.x.y")"), kBicycle);
    EXPECT_EQ(label(R"("attributes": {"base_type": ""}, "type_id": "vehicle.bh.crossbike")"), kBicycle);
    EXPECT_EQ(label(R"("type_id": "walker.pedestrian.0012")"), kPerson);
    EXPECT_EQ(label(R"("type_id": "traffic.speed_limit.30")"), kSign);
    EXPECT_EQ(label(R"("type_id": "traffic.traffic_light")"), 6);
    EXPECT_EQ(label(R"("type": "Dynamic")"), -1);
    EXPECT_TRUE(says(carla(R"([{"type_id": "vehicle.x.y", )" + kPlace + "}]"), "vehicle.x.y (1 objects)"));
    const auto mapped = carla(R"([{"type_id": "vehicle.x.y", )" + kPlace + R"(}, {"tags": [21], )" + kPlace + "}]",
                              {.map = folder_.put("map.json", R"({"vehicle.x.y": "bus", "21": "person"})")});
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(mapped->objects.at(0).label, 15);
    EXPECT_EQ(mapped->objects.at(1).label, kPerson);
}

TEST_F(ObjectBoxes, broken_carla_boxes_are_refused_with_their_number)
{
    const auto refused = [&](const std::string& fields, std::string_view text) {
        EXPECT_TRUE(says(carla(R"([{"type": "Car", )" + kPlace + "}, {" + fields + "}]"), text)) << fields;
    };
    refused(R"("type": "Car")", "boxes.json' box 1: location: expected an array of 3 numbers");
    refused(kPlace, "box 1: expected class, type, tags, base_type or type_id");
    refused(R"("type": "Car", "location": {"x": 1, "y": 2})", "box 1: location: z is missing");
    refused(R"("type": "Car", "location": [1, 2, "3"])", "box 1: location: expected a number, found string");
    refused(R"("type": "Car", "rotaton": [0, 0, 0])", "box 1: unknown key 'rotaton'");
    refused(R"("type": 7, )" + kPlace, "box 1: type: expected a string");
    refused(R"("tags": [], )" + kPlace, "box 1: tags: expected an array of numbers");
    refused(R"("tags": [99], )" + kPlace, "tag 99 (1 objects)");
    refused(R"("type": "Car", "id": -1, )" + kPlace, "box 1: id: expected a whole number");
    refused(R"("type": "Car", "transform": 1, )" + kPlace, "box 1: transform: expected an object, found number");
    refused(R"("type": "Car", "transform": {"location": [0, 0, 0]}, )" + kPlace, "box 1: transform: rotation");
    for (const char* color : {"\"1,2\"", "\"1,2,256\"", "\"1,2,3,4\"", "\"1;2;3\"", "\"\"", "\"1,2,-3\"", "[1, 2, 3]"})
        refused(R"("type": "Car", "color": )" + std::string(color) + ", " + kPlace, "box 1: color: expected \"r,g,b\"");
    EXPECT_TRUE(says(carla("{}"), "boxes.json': expected an array"));
    const std::string twice = R"({"type": "Car", "id": 4, )" + kPlace + "}";
    EXPECT_TRUE(says(carla("[" + twice + "," + twice + "]"), "box 1: id 4 is given twice"));
    // ids of 64 bits do not fit: all are counted
    const auto file = carla("[" + twice + R"(,{"type": "Car", "id": 9876543210123, )" + kPlace + "}]");
    EXPECT_EQ(file->objects.at(0).id, 0u);
    EXPECT_EQ(file->objects.at(1).id, 1u);
}

TEST_F(ObjectBoxes, a_format_is_found_only_where_there_is_no_doubt)
{
    const auto found = [&](const char* name, const std::string& text) {
        return detect_box_format(folder_.put(name, text));
    };
    EXPECT_EQ(found("a.txt", "\n" + kDontCare), BoxFormat::kitti);
    EXPECT_EQ(found("b.txt", "0 -1 " + kDontCare), BoxFormat::kitti);
    EXPECT_EQ(found("c.txt", "1 2 3 4 5 6 7 8 9 10 11 12\n"), std::nullopt);
    EXPECT_EQ(found("d.txt", "Car 1 2 3\n"), std::nullopt);
    EXPECT_EQ(found("sample_annotation.json", "[]"), BoxFormat::nuscenes);
    EXPECT_EQ(found("e.json", "{\"laserLabels\": []}"), BoxFormat::waymo);
    EXPECT_EQ(found("f.json", "[]"), std::nullopt);
    EXPECT_EQ(found("g.csv", kWaymoHeader), BoxFormat::waymo);
    EXPECT_EQ(found("i.txt", "\xef\xbb\xbf" + kAhead), BoxFormat::kitti); // a byte order mark in front
    EXPECT_EQ(found("h.csv", "a,b\n"), std::nullopt);
    EXPECT_EQ(detect_box_format(folder_ / "missing.txt"), std::nullopt);
    EXPECT_EQ(detect_box_format(folder_.path()), std::nullopt);
}

// bytes changed, cut and doubled at random: an error or objects, never a crash (run under AddressSanitizer, too)
TEST_F(ObjectBoxes, garbage_is_refused_or_read)
{
    const std::pair<BoxFormat, std::string> files[] = {
        {BoxFormat::kitti, "0 7 " + kAhead + "0 8 " + kAcross},
        {BoxFormat::waymo, "{\"laserLabels\": " + kWaymoLabels + "}"},
        {BoxFormat::carla, "[{\"type\": \"Car\", \"color\": \"1,2,3\", " + kPlace + "}]"}};
    std::mt19937 random(9);
    size_t refused = 0;
    for (const auto& [format, whole] : files)
        for (int n = 0; n < 300; ++n) {
            std::string text = whole;
            for (uint32_t changes = random() % 4; changes-- > 0;)
                text[random() % text.size()] = char(random() % 256);
            if (random() % 3 == 0)
                text.resize(random() % text.size());
            refused += !read(format, "garbage", text);
        }
    EXPECT_GT(refused, 300u);
    EXPECT_LT(refused, 900u);
}

} // namespace engine_object_boxes_test
} // namespace semrover
