// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/camera_view.h"
#include "engine/camera/rig.h"
#include "engine/deferred/frame_images.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/trajectory/camera_path.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace semrover {
namespace engine_camera_test {

const Intrinsics kView = pinhole_from_fov(90, 616, 424);

void expect_near(const Rigid& a, const Rigid& b, double tolerance)
{
    for (size_t i = 0; i < 16; ++i)
        EXPECT_NEAR(a[i], b[i], tolerance) << "element " << i;
}

// a path of `count` arbitrary poses with times that are not round
CameraPath random_path(size_t count)
{
    std::mt19937 random(11);
    const auto number = [&] { return static_cast<double>(random()) / 2147483648.0 - 1; };
    CameraPath path;
    while (path.frames.size() < count) {
        Quaternion q = {number(), number(), number(), number()};
        const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (double& v : q)
            v /= norm;
        const Rigid pose = rigid_from_quaternion({number() * 900, number() * 900, number()}, q, "t").value();
        path.frames.push_back({0.1 * static_cast<double>(path.frames.size()), "", {pose}, kView});
    }
    return path;
}

// pixels of the corners of a cube of edge 2 around (3, 0, 0), seen from the origin along +x with 90 degrees and 8 x 8
void expect_cube(const CameraFrame& frame)
{
    for (const double x : {2.0, 4.0})
        for (const double y : {-1.0, 1.0})
            for (const double z : {-1.0, 1.0}) {
                const auto pixel = project(frame, {x, y, z});
                ASSERT_TRUE(pixel);
                EXPECT_NEAR(pixel->x, 4 - 4 * y / x, 1e-9); // left in the world is left in the picture
                EXPECT_NEAR(pixel->y, 4 - 4 * z / x, 1e-9); // up is up
                EXPECT_NEAR(pixel->depth, x, 1e-9);
            }
    EXPECT_FALSE(project(frame, {-1, 0, 0}));
}

TEST(Camera, a_known_cube_falls_on_known_pixels_from_every_format)
{
    const ScratchFolder folder;
    const Intrinsics view = pinhole_from_fov(90, 8, 8);
    EXPECT_DOUBLE_EQ(view.fx, 4);
    EXPECT_DOUBLE_EQ(view.cx, 4);
    expect_cube(read_tum(folder.put("a.tum", "0 0 0 0 -0.5 0.5 -0.5 0.5"), view)->frames[0]);
    // right = -y, up = +z, back = -x
    const auto transforms = read_transforms(folder.put("a.json", R"({"w":8,"h":8,"camera_angle_x":1.5707963267948966,
        "frames":[{"transform_matrix":[[0,0,-1,0],[-1,0,0,0],[0,1,0,0],[0,0,0,1]]}]})"));
    ASSERT_TRUE(transforms) << transforms.error().message;
    expect_cube(transforms->frames[0]);
}

TEST(Camera, pixel_centres_are_at_one_half)
{
    const CameraFrame frame{0, "", {}, pinhole_from_fov(90, 2, 2)};
    // the ray through the centre of pixel (0, 0) of 2 x 2 is halfway between the axis and the corner
    const auto pixel = project(frame, {-0.5, -0.5, 1});
    EXPECT_DOUBLE_EQ(pixel->x, 0.5);
    EXPECT_DOUBLE_EQ(pixel->y, 0.5);
    EXPECT_NEAR(project(frame, {-1, -1, 1})->x, 0, 1e-15);
}

TEST(Camera, a_scaled_view_sees_the_same_edges)
{
    const Intrinsics half = scaled_to(kView, 308, 106);
    EXPECT_DOUBLE_EQ(half.fx, kView.fx / 2);
    EXPECT_DOUBLE_EQ(half.cx, 154);
    EXPECT_DOUBLE_EQ(half.fy, kView.fy / 4);
    EXPECT_DOUBLE_EQ(half.cy, 53);
    const Intrinsics back = scaled_to(half, 616, 424);
    EXPECT_DOUBLE_EQ(back.fx, kView.fx);
    EXPECT_DOUBLE_EQ(back.cy, kView.cy);
}

TEST(Camera, the_street_path_drives_along_the_road)
{
    const auto path = read_tum(SEMROVER_SOURCE_DIR "/assets/scenes/street.tum", kView);
    ASSERT_TRUE(path) << path.error().message;
    ASSERT_EQ(path->frames.size(), 24u);
    const CameraFrame& first = path->frames[0];
    EXPECT_EQ(first.intrinsics, kView);
    const auto ahead = project(first, {11, 0, 1.7});
    EXPECT_NEAR(ahead->x, 308, 1e-9);
    EXPECT_NEAR(ahead->y, 212, 1e-9);
    EXPECT_NEAR(ahead->depth, 10, 1e-9);
    EXPECT_LT(project(first, {11, 2, 1.7})->x, 308); // left of the road
    EXPECT_GT(project(first, {11, 0, 0})->y, 212);   // the road itself
    for (const CameraFrame& frame : path->frames)
        EXPECT_NEAR(translation_of(frame.pose.camera_to_world())[2], 1.7, 1e-9);
    EXPECT_DOUBLE_EQ(path->frames[23].time, 2.3);
}

TEST(Camera, a_tum_path_reads_back_the_same)
{
    const ScratchFolder folder;
    const CameraPath path = random_path(50);
    ASSERT_TRUE(write_tum(folder / "a.tum", path));
    const auto read = read_camera_path(folder / "a.tum", kView);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->frames.size(), 50u);
    for (size_t i = 0; i < 50; ++i) {
        EXPECT_EQ(read->frames[i].time, path.frames[i].time);
        expect_near(read->frames[i].pose.world_to_camera, path.frames[i].pose.world_to_camera, 1e-11);
    }
}

TEST(Camera, a_transforms_file_reads_back_the_same)
{
    const ScratchFolder folder;
    CameraPath path = random_path(12);
    for (size_t i = 0; i < 12; ++i)
        path.frames[i].camera = i % 2 ? "left" : "front";
    path.frames[5].intrinsics = {300, 310, 151.5, 99.25, 303, 201};
    ASSERT_TRUE(write_transforms(folder / "a.json", path));
    const auto read = read_camera_path(folder / "a.json", pinhole_from_fov(60, 10, 10));
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->frames.size(), 12u);
    for (size_t i = 0; i < 12; ++i) {
        EXPECT_EQ(read->frames[i].time, path.frames[i].time);
        EXPECT_EQ(read->frames[i].camera, path.frames[i].camera);
        EXPECT_EQ(read->frames[i].intrinsics, path.frames[i].intrinsics);
        expect_near(read->frames[i].pose.world_to_camera, path.frames[i].pose.world_to_camera, 1e-11);
    }
    EXPECT_NE(contents(folder / "a.json").find("\"left/color/000005.png\""), std::string::npos);
}

TEST(Camera, intrinsics_of_a_transforms_file_come_from_frame_then_file_then_fallback)
{
    const ScratchFolder folder;
    const std::string pose = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]])";
    const auto read = [&](const std::string& file, const std::string& frame, std::optional<Intrinsics> fallback = {}) {
        return read_transforms(folder.put("a.json", fmt::format("{{{}\"frames\":[{{{}{}}}]}}", file, frame, pose)),
                               fallback);
    };
    EXPECT_EQ(read(R"("w":20,"h":10.0,"fl_x":7,"fl_y":8,"cx":9,"cy":4,)", "")->frames[0].intrinsics,
              (Intrinsics{7, 8, 9, 4, 20, 10}));
    EXPECT_EQ(read(R"("w":20,"h":10,"fl_x":7,)", "")->frames[0].intrinsics, (Intrinsics{7, 7, 10, 5, 20, 10}));
    EXPECT_EQ(read(R"("w":20,"h":10,"fl_x":7,)", R"("w":40,"fl_x":14,)")->frames[0].intrinsics,
              (Intrinsics{14, 14, 20, 5, 40, 10}));
    EXPECT_NEAR(read(R"("camera_angle_x":1.5707963267948966,)", "", kView)->frames[0].intrinsics.fx, 308, 1e-9);
    EXPECT_EQ(read("", "", kView)->frames[0].intrinsics, kView);
    EXPECT_DOUBLE_EQ(read(R"("w":308,"h":212,)", "", kView)->frames[0].intrinsics.fx, kView.fx / 2);
    EXPECT_TRUE(says(read(R"("fl_x":7,)", ""), "frame 0: no image size (w, h)"));
    EXPECT_TRUE(says(read(R"("w":20,"h":10,)", ""), "frame 0: no focal length"));
    EXPECT_TRUE(says(read(R"("w":0,"h":10,"fl_x":7,)", ""), "frame 0: w: expected an image size of 1 to 16384"));
    EXPECT_TRUE(says(read(R"("w":1.5,"h":10,"fl_x":7,)", ""), "expected an image size"));
    EXPECT_TRUE(says(read(R"("w":"20","h":10,"fl_x":7,)", ""), "frame 0: w: expected a number, found string"));
    EXPECT_TRUE(says(read(R"("w":20,"h":10,"fl_x":-7,)", ""), "expected focal lengths above 0"));
    EXPECT_TRUE(says(read(R"("camera_model":"PINHOLE","w":20,"h":10,"fl_x":7,)", R"("k1":0.1,)"),
                     "lens distortion k1 = 0.1 is not one of camera_model PINHOLE"));
    EXPECT_TRUE(says(read(R"("w":20,"h":10,"fl_x":7,)", R"("k4":0.1,)"), // r^8 to nerfstudio, another thing to OpenCV
                     "lens distortion k4 = 0.1 is not one of camera_model OPENCV"));
    EXPECT_TRUE(says(read(R"("camera_model":"FISHEYE624","w":20,"h":10,"fl_x":7,)", ""),
                     "camera_model 'FISHEYE624' is not supported"));
    EXPECT_TRUE(says(read(R"("camera_model":7,"w":20,"h":10,"fl_x":7,)", ""), "camera_model '7' is not supported"));
    EXPECT_TRUE(says(read(R"("camera_model":"EQUIRECTANGULAR","w":20,"h":10,"fl_x":7,)", ""),
                     "fl_x: expected 10 of a panorama of the whole sphere, found 7"));
    EXPECT_TRUE(says(read(R"("w":20,"h":10,"fl_x":7,)", R"("k1":1e7,)"), "distortion coefficients of at most"));
    EXPECT_TRUE(says(read(R"("w":20,"h":10,"fl_x":7,)", R"("p1":"x",)"), "p1: expected a number, found string"));
    EXPECT_TRUE(read(R"("camera_model":"PINHOLE","k1":0,"p2":0.0,"w":20,"h":10,"fl_x":7,)", ""));
    EXPECT_TRUE(
        says(read(R"("w":20,"h":10,"fl_x":7,)", R"("camera":"../../etc",)"), "camera: expected a name of letters"));
    EXPECT_TRUE(says(read(R"("w":20,"h":10,"fl_x":7,)", R"("time":"x",)"), "time: expected a number"));
}

TEST(Camera, a_transforms_file_of_another_form_is_refused)
{
    const ScratchFolder folder;
    const auto read = [&](const char* text) { return read_transforms(folder.put("a.json", text), kView); };
    const auto pose = [&](const char* matrix) {
        return read(fmt::format(R"({{"frames":[{{"transform_matrix":{}}}]}})", matrix).c_str());
    };
    EXPECT_TRUE(says(read("[]"), "expected an object with an array of frames"));
    EXPECT_TRUE(says(read("{\"frames\":7}"), "expected an object with an array of frames"));
    EXPECT_TRUE(says(read("{\"frames\":[]}"), "a trajectory without poses"));
    EXPECT_TRUE(says(read("{\"frames\":[7]}"), "frame 0: expected an object with a transform_matrix"));
    EXPECT_TRUE(says(pose("7"), "transform_matrix: expected an array of numbers"));
    EXPECT_TRUE(says(pose("[[1,0,0,0]]"), "expected a 4x4 or 3x4 matrix, found 4 numbers"));
    EXPECT_TRUE(says(pose("[[1,0,0,\"x\"],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), "expected a number, found string"));
    EXPECT_TRUE(says(pose("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]"), "expected a rotation without scale or mirror"));
    EXPECT_TRUE(says(pose("[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), "mirrored"));
    EXPECT_TRUE(says(pose("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]"), "last row is 0 0 0 1"));
    EXPECT_TRUE(pose("[[1,0,0,5],[0,1,0,0],[0,0,1,0]]"));
}

TEST(Camera, a_broken_tum_line_is_named)
{
    const ScratchFolder folder;
    const auto read = [&](const char* text) { return read_tum(folder.put("a.tum", text), kView); };
    EXPECT_TRUE(says(read(""), "a trajectory without poses"));
    EXPECT_TRUE(says(read("# only\n\n  # comments\n"), "a trajectory without poses"));
    EXPECT_TRUE(
        says(read("# c\n0 0 0 0 0 0 0\n"), "a.tum' line 2: expected the 8 numbers t tx ty tz qx qy qz qw, found 7"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 1 9\n"), "line 1: expected the 8 numbers t tx ty tz qx qy qz qw, found more"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 one\n"), "line 1: expected a number, found 'one'"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 1x\n"), "expected a number, found '1x'"));
    EXPECT_TRUE(says(read("0 nan 0 0 0 0 0 1\n"), "a number that is not finite"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 1\n0 1e300 0 0 0 0 0 1\n"), "a.tum' line 2: a pose at 1e+300, 0, 0 m"));
    EXPECT_TRUE(says(read("inf 0 0 0 0 0 0 1\n"), "a time that is not finite"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 1e999\n"), "expected a number"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 0\n"), "expected a quaternion of norm 1, found 0"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 1.2\n"), "expected a quaternion of norm 1, found 1.2"));
    EXPECT_TRUE(says(read_tum(folder / "none", kView), "No such file"));
    EXPECT_TRUE(says(read_tum(folder.put("b", "0 0 0 0 0 0 0 1"), {}), "an image of 0 x 0 pixels"));
    const auto good = read("0\t+1 0 0 0 0 0 1.05 # note\r\n\r\n1 0 0 0 0 0 0 -1");
    ASSERT_TRUE(good) << good.error().message;
    EXPECT_EQ(good->frames.size(), 2u);
    expect_near(good->frames[1].pose.world_to_camera, kIdentity, 1e-15);
    EXPECT_DOUBLE_EQ(translation_of(good->frames[0].pose.camera_to_world())[0], 1);
}

TEST(Camera, a_path_file_over_16_mib_is_refused)
{
    const ScratchFolder folder;
    const auto file = folder.put("a.tum", std::string((16u << 20) + 1, '\n'));
    EXPECT_TRUE(says(read_tum(file, kView), "expected at most 16777216 bytes"));
    EXPECT_TRUE(says(read_transforms(file, kView), "expected at most 16777216 bytes"));
}

TEST(Camera, sky_is_where_a_ray_goes_up_and_meets_nothing)
{
    const Intrinsics lenses[] = {
        pinhole_from_fov(70, 101, 66), // no ray is exactly level
        {60, 60, 50, 33, 101, 67, CameraModel::opencv, {-0.25, 0.06, 0.01, 0.002}},
        {22, 22, 50, 33, 101, 67, CameraModel::fisheye, {0.01}}, // blind in its corners
        whole_sphere(120, 60),
    };
    const Quaternion turns[] = {{-0.5, 0.5, -0.5, 0.5}, {0.1, -0.7, 0.3, 0.64}, {0, 0, 0, 1}, {1, 0, 0, 0}};
    for (const Intrinsics& k : lenses)
        for (const Quaternion& q : turns) {
            const CameraFrame frame{0, "", {inverse(*rigid_from_quaternion({1, 2, 3}, q, "turn"))}, k};
            FramePixels pixels{.width = k.width, .height = k.height};
            pixels.normals.assign(k.width * k.height, 255u << 24 | 7);
            for (size_t i = 0; i < pixels.normals.size(); i += 3)
                pixels.normals[i] = 2u << 24; // a building
            mark_sky(pixels, frame);
            const Lens lens(k);
            const Rigid m = frame.pose.camera_to_world();
            for (uint32_t i = 0; i < pixels.normals.size(); ++i) {
                const auto ray = lens.ray(i % k.width + 0.5, i / k.width + 0.5);
                const bool up = ray && m[8] * (*ray)[0] + m[9] * (*ray)[1] + m[10] * (*ray)[2] > 0;
                const uint32_t expected = i % 3 == 0 ? 2u << 24 : (up ? 10u : 255u) << 24 | 7;
                ASSERT_EQ(pixels.normals[i], expected) << name_of(k.model) << " pixel " << i;
            }
        }
}

TEST(Rigid, an_inverse_undoes_and_a_quaternion_returns)
{
    for (const CameraFrame& frame : random_path(100).frames) {
        const Rigid& a = frame.pose.world_to_camera;
        expect_near(compose(a, inverse(a)), kIdentity, 1e-12);
        expect_near(rigid_from_quaternion(translation_of(a), quaternion_of(a), "t").value(), a, 1e-13);
        EXPECT_GE(quaternion_of(a)[3], 0);
    }
    for (const Quaternion& q : {Quaternion{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}) // half turns
        expect_near(rigid_from_quaternion({}, quaternion_of(rigid_from_quaternion({}, q, "t").value()), "t").value(),
                    rigid_from_quaternion({}, q, "t").value(), 1e-15);
}

TEST(Rigid, between_two_poses_the_turn_is_even_and_the_shorter_way)
{
    const auto turned = [](double x, double radians) { // about an axis that leans
        const double s = std::sin(radians / 2) / 3;
        return rigid_from_quaternion({x, 2 * x, -x}, {s, 2 * s, 2 * s, std::cos(radians / 2)}, "t").value();
    };
    for (const double from : {-2.0, 0.0, 0.3, 3.0})
        for (const double by : {-3.1, -1.0, -1e-7, 0.0, 1e-12, 0.5, 3.1})
            for (const double share : {-0.5, 0.0, 0.25, 1 / 3.0, 0.5, 0.999, 1.0, 1.5})
                expect_near(interpolate(turned(1, from), turned(5, from + by), share),
                            turned(1 + 4 * share, from + by * share), 1e-14);
    // more than half a turn is less than half of one the other way
    expect_near(interpolate(turned(0, 0), turned(0, 4), 0.5), turned(0, (4 - 2 * std::numbers::pi) / 2), 1e-14);
    for (const CameraFrame& frame : random_path(100).frames) {
        const Rigid& a = frame.pose.world_to_camera;
        const Rigid b = compose(a, turned(3, 1.5));
        EXPECT_EQ(interpolate(a, b, 0), a);
        EXPECT_EQ(interpolate(a, b, 1), b);
        EXPECT_EQ(interpolate(a, a, 0.37), a);
        expect_near(interpolate(a, b, 0.3), interpolate(b, a, 0.7), 1e-11);
    }
}

constexpr const char* kRig = R"({"sensors":[
    {"name":"front","model":"pinhole","width":8,"height":8,"fov":90,
     "sensor_to_vehicle":{"translation":[1,0,0.5],"rotation":[-0.5,0.5,-0.5,0.5]}},
    {"name":"left","width":8,"height":4,"fx":4,"fy":4,"cx":4,"cy":2,
     "sensor_to_vehicle":[[1,0,0,0],[0,0,1,0],[0,-1,0,0],[0,0,0,1]]}]})";

TEST(Rig, every_pose_of_the_path_gives_a_frame_of_every_sensor)
{
    const ScratchFolder folder;
    const auto rig = read_rig(folder.put("rig.json", kRig));
    ASSERT_TRUE(rig) << rig.error().message;
    const auto drive = read_tum(folder.put("a.tum", "0 10 0 0 -0.5 0.5 -0.5 0.5\n1 20 0 0 -0.5 0.5 -0.5 0.5"), kView);
    const CameraPath path = *expand_rig(*rig, *drive);
    ASSERT_EQ(path.frames.size(), 4u);
    EXPECT_EQ(path.frames[2].camera, "front");
    EXPECT_EQ(path.frames[2].time, 1);
    EXPECT_EQ(path.frames[3].camera, "left");
    EXPECT_EQ(path.frames[3].intrinsics, (Intrinsics{4, 4, 4, 2, 8, 4}));
    // front: at x = 11, 0.5 m up; left: looks along +y
    const auto front = project(path.frames[0], {13, 0, 0.5});
    EXPECT_NEAR(front->x, 4, 1e-12);
    EXPECT_NEAR(front->y, 4, 1e-12);
    EXPECT_NEAR(front->depth, 2, 1e-12);
    const auto left = project(path.frames[1], {11, 4, 1}); // ahead of the vehicle is right in the left picture
    EXPECT_NEAR(left->x, 5, 1e-12);
    EXPECT_NEAR(left->y, 1, 1e-12);
    EXPECT_NEAR(left->depth, 4, 1e-12);
}

TEST(Rig, a_path_of_vehicle_poses_is_taken_as_such)
{
    const ScratchFolder folder;
    std::string text = kRig;
    text.insert(1, R"("path_axes":"vehicle",)");
    const auto rig = read_rig(folder.put("rig.json", text));
    ASSERT_TRUE(rig) << rig.error().message;
    const auto drive = read_tum(folder.put("a.tum", "0 10 0 0 0 0 0 1"), kView);
    EXPECT_NEAR(project(expand_rig(*rig, *drive)->frames[0], {13, 0, 0.5})->depth, 2, 1e-12);
}

TEST(Rig, sensors_may_have_any_lens)
{
    const ScratchFolder folder;
    const auto rig = read_rig(folder.put("rig.json", R"({"comment":"three lenses","sensors":[
        {"name":"a","model":"fisheye","width":100,"height":80,"fov":180,"distortion":[0.1,0,0,0.2],
         "sensor_to_vehicle":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
        {"name":"b","model":"opencv","width":100,"height":80,"fov":90,"distortion":[0.1,0.2,0.3,0.4,0.5],
         "sensor_to_vehicle":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
        {"name":"c","model":"equirectangular","width":100,"height":50,
         "sensor_to_vehicle":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
        {"name":"d","model":"opencv","width":100,"height":80,"fov":90,"distortion":[0,0,0,0],
         "sensor_to_vehicle":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})"));
    ASSERT_TRUE(rig) << rig.error().message;
    Intrinsics a = fisheye_from_fov(180, 100, 80), b = pinhole_from_fov(90, 100, 80);
    a.distortion = {0.1, 0, 0, 0.2};
    b.model = CameraModel::opencv;
    b.distortion = {0.1, 0.2, 0.3, 0.4, 0.5};
    EXPECT_NEAR(a.fx, 100 / std::numbers::pi, 1e-12);
    EXPECT_EQ(rig->sensors[0].intrinsics, a);
    EXPECT_EQ(rig->sensors[1].intrinsics, b);
    EXPECT_EQ(rig->sensors[2].intrinsics, whole_sphere(100, 50));
    EXPECT_EQ(rig->sensors[3].intrinsics, pinhole_from_fov(90, 100, 80)); // without distortion
}

constexpr const char* kRolling = R"({"path_axes":"vehicle","sensors":[
    {"name":"a","width":80,"height":60,"fov":90,"shutter":{"direction":"up","start":-20000,"readout":30000},
     "sensor_to_vehicle":{"translation":[1,0,2],"rotation":[-0.5,0.5,-0.5,0.5]}},
    {"name":"b","width":80,"height":60,"fov":90,
     "sensor_to_vehicle":{"translation":[1,0,2],"rotation":[-0.5,0.5,-0.5,0.5]}}]})";

TEST(Rig, a_rolling_shutter_sees_from_where_the_vehicle_is_meanwhile)
{
    const ScratchFolder folder;
    const auto rig = read_rig(folder.put("rig.json", kRolling));
    ASSERT_TRUE(rig) << rig.error().message;
    EXPECT_EQ(rig->sensors[0].shutter, (Shutter{ShutterDirection::up, -20000, 30000}));
    EXPECT_FALSE(rig->sensors[1].shutter);
    // turns at 1 rad/s while it goes at 10 m/s, then at 20; it stands at the end
    std::string path;
    for (const auto& [time, x, yaw] :
         {std::tuple{5.0, 0.0, 0.0}, {5.1, 1.0, 0.1}, {5.2, 3.0, 0.2}, {5.3, 5.0, 0.2}, {5.4, 5.0, 0.2}})
        path += fmt::format("{} {} 0 0 0 0 {} {}\n", time, x, std::sin(yaw / 2), std::cos(yaw / 2));
    const auto drive = read_tum(folder.put("a.tum", path), kView);
    const auto frames = expand_rig(*rig, *drive);
    ASSERT_TRUE(frames) << frames.error().message;
    const auto vehicle = [&](double x, double yaw) {
        return rigid_from_quaternion({x, 0, 0}, {0, 0, std::sin(yaw / 2), std::cos(yaw / 2)}, "t").value();
    };
    const Rigid mounting = rig->sensors[0].sensor_to_vehicle;
    const auto expect = [&](size_t i, const Rigid& from, const Rigid& to) {
        ASSERT_TRUE(frames->frames[2 * i].readout);
        const Readout& r = *frames->frames[2 * i].readout;
        EXPECT_EQ(r.direction, ShutterDirection::up);
        expect_near(r.from.camera_to_world(), compose(from, mounting), 1e-9);
        expect_near(r.to.camera_to_world(), compose(to, mounting), 1e-9);
        EXPECT_FALSE(frames->frames[2 * i + 1].readout);
        EXPECT_EQ(frames->frames[2 * i].pose.world_to_camera, frames->frames[2 * i + 1].pose.world_to_camera);
    };
    expect(0, vehicle(-0.2, -0.02), vehicle(0.1, 0.01)); // goes on as from the first pose to the second
    expect(1, vehicle(0.8, 0.08), vehicle(1.2, 0.11));   // faster after the pose
    expect(2, vehicle(2.6, 0.18), vehicle(3.2, 0.2));
    const CameraFrame& last = frames->frames[8];
    EXPECT_FALSE(last.moves()); // to the bit
    EXPECT_EQ(last.readout->from.world_to_camera, last.pose.world_to_camera);
    EXPECT_EQ(last.readout->to.world_to_camera, last.pose.world_to_camera);
    // one pose: it stands
    const auto one = expand_rig(*rig, *read_tum(folder.put("b.tum", "5 1 2 3 0 0 0 1"), kView));
    ASSERT_TRUE(one);
    EXPECT_FALSE(one->frames[0].moves());
    // written and read again
    folder.put("again.json", rig_json(rig->sensors).dump());
    EXPECT_EQ(read_rig(folder / "again.json")->sensors[0].shutter, rig->sensors[0].shutter);
    EXPECT_TRUE(says(expand_rig(*rig, *read_tum(folder.put("c.tum", "5 0 0 0 0 0 0 1\n5 1 0 0 0 0 0 1"), kView)),
                     "rolling shutters and lidars need poses at times that rise: pose 1 is at 5 s"));
    CameraPath numbered = *drive;
    numbered.numbered = true;
    EXPECT_TRUE(says(expand_rig(*rig, numbered), "a rolling shutter needs poses with times"));
}

// each line as a camera that stands where this one is then
TEST(CameraView, a_moving_camera_sees_a_point_in_the_line_that_is_read_then)
{
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit(-1, 1);
    size_t seen = 0;
    for (const Intrinsics& k :
         {pinhole_from_fov(80, 200, 150), fisheye_from_fov(190, 160, 160), whole_sphere(200, 100)})
        for (int i = 0; i < 200; ++i) {
            const auto pose = [&](double seconds) {
                const double half = 0.4 * seconds;
                return rigid_from_quaternion({15 * seconds, -3 * seconds, 2 * seconds},
                                             {std::sin(half) * 0.6, std::sin(half) * 0.8, 0, std::cos(half)}, "t")
                    .value();
            };
            CameraFrame frame;
            frame.intrinsics = k;
            const auto direction = ShutterDirection(i % 4);
            frame.readout = Readout{direction, {inverse(pose(0))}, {inverse(pose(0.04))}};
            const CameraView view(frame);
            const double x = k.width * (0.5 + 0.5 * unit(random)), y = k.height * (0.5 + 0.5 * unit(random));
            const auto place = view.surface(x, y, 6 + 4 * unit(random));
            if (!place)
                continue;
            const auto at = view.project(*place);
            ASSERT_TRUE(at) << i;
            if (k.model == CameraModel::equirectangular && std::min(x, k.width - x) < 10)
                continue; // seen on both sides
            ++seen;
            EXPECT_NEAR(at->x, x, 1e-6) << name_of(k.model) << " " << i;
            EXPECT_NEAR(at->y, y, 1e-6) << name_of(k.model) << " " << i;
            const double line = i % 4 < 2 ? y / k.height : x / k.width, share = i % 2 ? 1 - line : line;
            CameraFrame still = frame;
            still.readout.reset();
            still.pose = {inverse(interpolate(pose(0), pose(0.04), share))};
            const auto then = project(still, *place);
            EXPECT_NEAR(then->x, x, 1e-6);
            EXPECT_NEAR(then->y, y, 1e-6);
            EXPECT_NEAR(then->depth, at->depth, 1e-9);
        }
    EXPECT_GT(seen, 450u);
}

TEST(Rig, ftheta_sensors_are_read_as_nvidia_writes_them)
{
    const ScratchFolder folder;
    const std::string lens = R"("model":"ftheta","width":1280,"height":720,"principal_point":[639.25,359.5],
        "reference_poly":"PIXELDIST_TO_ANGLE","pixeldist_to_angle_poly":[0,0.00192,2.1e-8,-3e-11,4e-14,-1e-17],
        "angle_to_pixeldist_poly":[0,520,0,0,0,0],"max_angle":1.5,"linear_cde":[0.9985,-0.0011,0.0006],)";
    const auto rig_of = [&](const std::string& text) {
        return read_rig(
            folder.put("r.json", R"({"sensors":[{"name":"a",)" + text +
                                     R"("sensor_to_vehicle":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})"));
    };
    const auto rig = rig_of(lens);
    ASSERT_TRUE(rig) << rig.error().message;
    const Intrinsics& k = rig->sensors[0].intrinsics;
    EXPECT_EQ(k, (Intrinsics{1,
                             1,
                             639.75,
                             360,
                             1280,
                             720,
                             CameraModel::ftheta,
                             {0.00192, 2.1e-8, -3e-11, 4e-14, -1e-17, 0.9985, -0.0011, 0.0006, 1.5, 1}}));
    for (const Intrinsics& scaled : {k, scaled_to(k, 640, 360), scaled_to(k, 640, 720)}) {
        std::vector<Sensor> sensors = rig->sensors;
        sensors[0].intrinsics = scaled;
        folder.put("again.json", rig_json(sensors).dump());
        const auto again = read_rig(folder / "again.json");
        ASSERT_TRUE(again) << again.error().message;
        for (const Point3& p : {Point3{0.3, -0.4, 1}, {-2, 1, 0.5}, {0.1, 1, 2}}) {
            const auto a = Lens(scaled).project(p), b = Lens(again->sensors[0].intrinsics).project(p);
            EXPECT_NEAR(a->x, b->x, 1e-9);
            EXPECT_NEAR(a->y, b->y, 1e-9);
            EXPECT_NEAR(a->x / scaled.width, Lens(k).project(p)->x / k.width, 1e-12);
        }
    }
    const auto changed = [&](std::string_view from, std::string_view to) {
        std::string text = lens;
        text.replace(text.find(from), from.size(), to);
        return rig_of(text);
    };
    EXPECT_TRUE(says(changed("PIXELDIST_TO_ANGLE\"", "BACKWARD\""), "reference_poly: expected \"PIXELDIST_TO_ANGLE\""));
    EXPECT_TRUE(says(changed("[0,0.00192", "[0.1,0.00192"), "expected 2 to 6 numbers, the first 0"));
    EXPECT_TRUE(says(changed("\"max_angle\":1.5,", ""), "max_angle is missing"));
    EXPECT_TRUE(says(changed("\"width\"", "\"fx\":3,\"width\""), "has a polynomial, without fov or fx"));
    EXPECT_TRUE(says(changed("\"ftheta\"", "\"pinhole\""), "principal_point, which a sensor of model pinhole has not"));
    EXPECT_TRUE(says(changed("[0.9985,-0.0011,0.0006]", "[1,0]"), "linear_cde: expected an array of 3 numbers"));
}

TEST(Rig, the_examples_look_where_their_names_say)
{
    const auto drive = read_tum(SEMROVER_SOURCE_DIR "/assets/scenes/street.tum", kView); // along +x, +y to the left
    for (const char* name : {"waymo", "pandaset"}) {
        SCOPED_TRACE(name);
        const auto rig = read_rig(fmt::format("{}/assets/rigs/{}.json", SEMROVER_SOURCE_DIR, name));
        ASSERT_TRUE(rig) << rig.error().message;
        EXPECT_EQ(rig->sensors.size(), std::string_view(name) == "waymo" ? 5u : 6u);
        const CameraPath path = *expand_rig(*rig, *drive);
        const Point3 at = translation_of(drive->frames[0].pose.camera_to_world());
        for (size_t i = 0; i < rig->sensors.size(); ++i) {
            const std::string& camera = path.frames[i].camera;
            const Rigid m = path.frames[i].pose.camera_to_world();
            const Point3 forward = {m[2], m[6], m[10]}, down = {m[1], m[5], m[9]}, where = translation_of(m);
            EXPECT_LT(down[2], -0.95) << camera;
            EXPECT_LT(std::hypot(where[0] - at[0], where[1] - at[1]), 1.5) << camera;
            EXPECT_LT(std::abs(where[2] - at[2]), 0.5) << camera;
            const Intrinsics& k = path.frames[i].intrinsics;
            const Lens lens(k);
            EXPECT_TRUE(lens.ray(0, k.cy) && lens.ray(k.width, k.cy) && lens.ray(k.cx, 0) && lens.ray(k.cx, k.height));
            const double sideways = camera.find("left") != std::string::npos    ? 1
                                    : camera.find("right") != std::string::npos ? -1
                                                                                : 0;
            const double ahead = camera == "back" ? -1 : camera.starts_with("front") ? 1 : 0;
            const double expected = std::atan2(sideways, ahead);
            EXPECT_NEAR(std::remainder(std::atan2(forward[1], forward[0]) - expected, 2 * std::numbers::pi), 0, 0.3)
                << camera;
        }
    }
}

TEST(Rig, what_is_wrong_with_a_rig_is_named)
{
    const ScratchFolder folder;
    const auto changed = [&](std::string_view from, std::string_view to) {
        std::string text = kRig;
        const size_t at = text.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        return read_rig(folder.put("rig.json", text.replace(at, from.size(), to)));
    };
    EXPECT_TRUE(says(read_rig(folder.put("r", "{\"sensors\":[]}")), "expected 1 to 64 sensors, found 0"));
    EXPECT_TRUE(says(read_rig(folder.put("r", "[]")), "expected an object with an array of sensors"));
    EXPECT_TRUE(says(changed("\"left\"", "\"front\""), "two sensors are called 'front'"));
    EXPECT_TRUE(says(changed("\"left\"", "\"a/b\""), "sensor 1: expected a name of letters"));
    EXPECT_TRUE(says(changed("\"pinhole\"", "\"mei\""), "sensor 0: model \"mei\" is not supported"));
    EXPECT_TRUE(says(changed("\"pinhole\"", "\"pinhole\",\"distortion\":[0.1,0,0,0]"),
                     "sensor 0: distortion: expected no numbers of model pinhole, found 4"));
    const std::string rolling = R"("pinhole","shutter":)";
    EXPECT_TRUE(says(changed("\"pinhole\"", rolling + "5"), "sensor 0: shutter: expected an object, found number"));
    EXPECT_TRUE(says(changed("\"pinhole\"", rolling + R"({"readout":5})"), "shutter: direction: expected \"down\""));
    EXPECT_TRUE(says(changed("\"pinhole\"", rolling + R"({"direction":"up"})"), "shutter: readout is missing"));
    EXPECT_TRUE(says(changed("\"pinhole\"", rolling + R"({"direction":"up","readout":1.5})"),
                     "readout: expected whole microseconds from 0 to 1000000, found 1.5"));
    EXPECT_TRUE(says(changed("\"pinhole\"", rolling + R"({"direction":"up","readout":5,"lines":3})"),
                     "shutter: unknown key 'lines'"));
    EXPECT_TRUE(says(changed("\"pinhole\"", "\"opencv\",\"distortion\":[0.1,0,0]"), "expected 4, 5, 8 or 12 numbers"));
    EXPECT_TRUE(says(changed("\"pinhole\"", "\"fisheye\",\"distortion\":[0.1,0,0,0,0]"), "expected 4 numbers"));
    EXPECT_TRUE(says(changed("\"pinhole\"", "\"equirectangular\""), "an equirectangular sensor sees the whole sphere"));
    EXPECT_TRUE(
        says(changed(R"("pinhole","width":8,"height":8,"fov":90)", R"("fisheye","width":8,"height":8,"fov":361)"),
             "expected a fov above 0 and at most 360 degrees, found 361"));
    EXPECT_TRUE(says(changed("\"fov\":90", "\"fov\":180"), "expected a fov above 0 and below 180 degrees"));
    EXPECT_TRUE(says(changed("\"fov\":90", "\"fov\":90,\"fx\":4"), "found both"));
    EXPECT_TRUE(says(changed("\"fov\":90", "\"fovx\":90"), "unknown key 'fovx'"));
    EXPECT_TRUE(says(changed("\"fy\":4,", ""), "sensor 1: fy is missing"));
    EXPECT_TRUE(says(changed("\"width\":8", "\"width\":0"), "sensor 0: width: expected an image size"));
    EXPECT_TRUE(says(changed("[1,0,0.5]", "[1,0]"), "expected a translation of 3"));
    EXPECT_TRUE(says(changed("[-0.5,0.5,-0.5,0.5]", "[0,0,0,0]"), "expected a quaternion of norm 1"));
    EXPECT_TRUE(says(changed("[1,0,0,0]", "[2,0,0,0]"), "sensor 1: sensor_to_vehicle: expected a rotation"));
    EXPECT_TRUE(says(changed("{\"sensors\"", "{\"path_axes\":\"x\",\"sensors\""), "path_axes: expected"));
}

} // namespace engine_camera_test
} // namespace semrover
