// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/camera_view.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/trajectory/camera_path.h"

#include <cmath>
#include <filesystem>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace semrover {
namespace engine_camera_files_test {

const Intrinsics kView = pinhole_from_fov(90, 616, 424);

void expect_near(const Rigid& a, const Rigid& b, double tolerance)
{
    for (size_t i = 0; i < 16; ++i)
        EXPECT_NEAR(a[i], b[i], tolerance) << "element " << i;
}

void expect_near(const Intrinsics& a, const Intrinsics& b, double tolerance)
{
    EXPECT_EQ(a.model, b.model);
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    for (const auto& [x, y] : {std::pair{a.fx, b.fx}, {a.fy, b.fy}, {a.cx, b.cx}, {a.cy, b.cy}})
        EXPECT_NEAR(x, y, tolerance);
    for (size_t i = 0; i < 8; ++i)
        EXPECT_NEAR(a.distortion[i], b.distortion[i], tolerance);
}

// `count` arbitrary poses, a second apart
CameraPath random_path(size_t count, const Intrinsics& intrinsics = kView)
{
    std::mt19937 random(17);
    const auto number = [&] { return double(random()) / 2147483648.0 - 1; };
    CameraPath path;
    while (path.frames.size() < count) {
        Quaternion q = {number(), number(), number(), number()};
        const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (double& v : q)
            v /= norm;
        const Rigid pose = rigid_from_quaternion({number() * 900, number() * 900, number()}, q, "t").value();
        path.frames.push_back({double(path.frames.size()), "", {pose}, intrinsics});
    }
    return path;
}

void expect_same(const CameraPath& a, const CameraPath& b)
{
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (size_t i = 0; i < a.frames.size(); ++i) {
        SCOPED_TRACE(i);
        EXPECT_NEAR(a.frames[i].time, b.frames[i].time, 1e-6);
        EXPECT_EQ(a.frames[i].camera, b.frames[i].camera);
        expect_near(a.frames[i].pose.world_to_camera, b.frames[i].pose.world_to_camera, 1e-6);
        expect_near(a.frames[i].intrinsics, b.frames[i].intrinsics, 1e-6);
    }
}

Status write(PathFormat format, const Path& path, const CameraPath& cameras)
{
    switch (format) {
    case PathFormat::tum:
        return write_tum(path, cameras);
    case PathFormat::kitti:
        return write_kitti(path, cameras);
    case PathFormat::transforms:
        return write_transforms(path, cameras);
    case PathFormat::camera_path:
        return write_camera_path_json(path, cameras);
    default:
        return write_colmap(path, cameras);
    }
}

// docs/formats.md §7.1: a path means the same in every format
TEST(CameraFiles, a_path_that_goes_through_all_five_formats_is_the_same)
{
    const ScratchFolder folder;
    const CameraPath path = random_path(20);
    CameraPath now = path;
    for (const auto& [format, file] : {std::pair{PathFormat::kitti, "poses.txt"},
                                       {PathFormat::transforms, "transforms.json"},
                                       {PathFormat::camera_path, "camera_path.json"},
                                       {PathFormat::colmap, "sparse"},
                                       {PathFormat::tum, "path.tum"}}) {
        SCOPED_TRACE(file);
        ASSERT_TRUE(write(format, folder / file, now));
        auto read = read_camera_path(folder / file, kView);
        ASSERT_TRUE(read) << read.error().message;
        now = std::move(*read);
        expect_same(now, path);
    }
}

// as editors of Windows write it in front of text
TEST(CameraFiles, a_byte_order_mark_is_skipped_in_every_format)
{
    const ScratchFolder folder;
    const CameraPath path = random_path(3);
    for (const auto& [format, file, texts] :
         {std::tuple{PathFormat::kitti, "poses.txt", std::vector<std::string>{"poses.txt", "times.txt"}},
          {PathFormat::transforms, "transforms.json", {"transforms.json"}},
          {PathFormat::camera_path, "camera_path.json", {"camera_path.json"}},
          {PathFormat::colmap, "sparse", {"sparse/cameras.txt", "sparse/images.txt"}},
          {PathFormat::tum, "path.tum", {"path.tum"}}}) {
        SCOPED_TRACE(file);
        ASSERT_TRUE(write(format, folder / file, path));
        for (const std::string& text : texts)
            folder.put(text, "\xef\xbb\xbf" + contents(folder / text));
        const auto read = read_camera_path(folder / file, kView);
        ASSERT_TRUE(read) << read.error().message;
        expect_same(*read, path);
    }
    EXPECT_TRUE(says(read_camera_path(folder.put("w.tum", std::string("\xff\xfe \0", 4)), kView), "UTF-16"));
}

// as instant-ngp has it: three keys of a frame
TEST(CameraFiles, a_readout_comes_back_from_transforms)
{
    const ScratchFolder folder;
    CameraPath path = random_path(5);
    for (size_t i = 0; i < 4; ++i)
        path.frames[i].readout =
            Readout{ShutterDirection(i), path.frames[i].pose, i ? path.frames[i + 1].pose : path.frames[i].pose};
    ASSERT_TRUE(write(PathFormat::transforms, folder / "a.json", path));
    const auto read = read_camera_path(folder / "a.json", kView);
    ASSERT_TRUE(read) << read.error().message;
    expect_same(*read, path);
    for (size_t i = 0; i < 4; ++i) {
        ASSERT_TRUE(read->frames[i].readout);
        EXPECT_EQ(read->frames[i].readout->direction, ShutterDirection(i));
        EXPECT_EQ(read->frames[i].moves(), i > 0); // the same pose stays the same
        for (size_t at = 0; at < 12; ++at)
            EXPECT_NEAR(read->frames[i].readout->to.world_to_camera[at], path.frames[i].readout->to.world_to_camera[at],
                        1e-9);
    }
    EXPECT_FALSE(read->frames[4].readout);
    const auto changed = [&](std::string_view from, std::string_view to) {
        Json file = Json::parse(contents(folder / "a.json"));
        Json& frame = file["frames"][1];
        if (to.empty())
            frame.erase(std::string(from));
        else
            frame[std::string(from)] = Json::parse(to);
        return read_camera_path(folder.put("b.json", file.dump()), kView);
    };
    EXPECT_TRUE(
        says(changed("transform_matrix_end", ""), "transform_matrix_start and transform_matrix_end need each other"));
    EXPECT_TRUE(says(changed("rolling_shutter", ""), "a rolling shutter is three keys"));
    EXPECT_TRUE(says(changed("rolling_shutter", "[0,0,1,0.5]"), "rolling_shutter: [0, 0, 1, 0.5] is not supported"));
}

// every lens through every format that has a place for it
TEST(CameraFiles, lenses_come_back)
{
    const ScratchFolder folder;
    Intrinsics plain{300, 310, 150.5, 99.25, 303, 201, CameraModel::opencv, {-0.1, 0.02, 0.003, -0.004}},
        third = plain, rational = plain,
        fisheye{200, 201, 160, 120, 320, 240, CameraModel::fisheye, {0.1, -0.02, 0.003, -0.0004}};
    third.distortion[4] = 0.05;
    rational.distortion = {-0.1, 0.02, 0.003, -0.004, 0.05, 0.06, 0.07, 0.08};
    Intrinsics prism = rational;
    prism.distortion[9] = 0.01;
    const Intrinsics ftheta{
        1, 1, 160.5, 119.5, 320, 240, CameraModel::ftheta, {200, 1, -2, 0.5, 0.1, 1.01, 0.001, -0.002, 1.4, 0}};
    for (const Intrinsics& k : {prism, ftheta}) { // no place in COLMAP's files
        SCOPED_TRACE(name_of(k.model));
        const CameraPath path = random_path(3, k);
        ASSERT_TRUE(write(PathFormat::transforms, folder / "a.json", path));
        const auto read = read_camera_path(folder / "a.json", kView);
        ASSERT_TRUE(read) << read.error().message;
        expect_same(*read, path);
        EXPECT_TRUE(says(write(PathFormat::colmap, folder / "b", path), "COLMAP has no model of"));
    }
    for (const Intrinsics& k : {plain, third, rational, fisheye, whole_sphere(64, 32)})
        for (const auto& [format, file] : {std::pair{PathFormat::transforms, "a.json"}, {PathFormat::colmap, "a"}}) {
            SCOPED_TRACE(fmt::format("{} {}", name_of(k.model), file));
            const CameraPath path = random_path(3, k);
            ASSERT_TRUE(write(format, folder / file, path));
            const auto read = read_camera_path(folder / file, kView);
            ASSERT_TRUE(read) << read.error().message;
            expect_same(*read, path);
        }
    for (const Intrinsics& k : {fisheye_from_fov(100, 64, 48), whole_sphere(64, 32), pinhole_from_fov(80, 50, 40)}) {
        const CameraPath path = random_path(3, k);
        ASSERT_TRUE(write_camera_path_json(folder / "b.json", path));
        const auto read = read_camera_path(folder / "b.json", kView);
        ASSERT_TRUE(read) << read.error().message;
        expect_same(*read, path);
    }
    CameraPath mixed = random_path(4, plain);
    mixed.frames[1].intrinsics = pinhole_from_fov(80, 50, 40);
    mixed.frames[2].intrinsics = fisheye;
    mixed.frames[3].intrinsics = whole_sphere(64, 32);
    for (const char* file : {"mixed.json", "mixed"}) {
        ASSERT_TRUE(write(file[5] ? PathFormat::transforms : PathFormat::colmap, folder / file, mixed));
        const auto read = read_camera_path(folder / file, kView);
        ASSERT_TRUE(read) << read.error().message;
        expect_same(*read, mixed);
    }
}

TEST(CameraFiles, cameras_of_a_rig_come_back_moment_by_moment)
{
    const ScratchFolder folder;
    CameraPath path = random_path(6);
    for (size_t i = 0; i < 6; ++i) {
        path.frames[i].camera = i % 2 ? "left" : "front";
        path.frames[i].time = double(i / 2);
    }
    for (const auto& [format, file] : {std::pair{PathFormat::transforms, "a.json"}, {PathFormat::colmap, "a"}}) {
        ASSERT_TRUE(write(format, folder / file, path));
        const auto read = read_camera_path(folder / file, kView);
        ASSERT_TRUE(read) << read.error().message;
        expect_same(*read, path);
    }
}

// pixels of the corners of a cube of edge 2 around (3, 0, 0), seen from the origin along +x, z up
void expect_cube(const Result<CameraPath>& path, double focal, double cx, double cy)
{
    ASSERT_TRUE(path) << path.error().message;
    for (const double x : {2.0, 4.0})
        for (const double y : {-1.0, 1.0})
            for (const double z : {-1.0, 1.0}) {
                const auto pixel = project(path->frames[0], {x, y, z});
                ASSERT_TRUE(pixel);
                EXPECT_NEAR(pixel->x, cx - focal * y / x, 1e-9);
                EXPECT_NEAR(pixel->y, cy - focal * z / x, 1e-9);
                EXPECT_NEAR(pixel->depth, x, 1e-9);
            }
}

// files by hand, from the specification of each
TEST(CameraFiles, a_known_cube_falls_on_known_pixels_from_every_format)
{
    const ScratchFolder folder;
    const Intrinsics view = pinhole_from_fov(90, 8, 8);
    // right = -y, down = -z, forward = +x
    expect_cube(read_camera_path(folder.put("poses.txt", "0 0 1 0 -1 0 0 0 0 -1 0 0\n"), view), 4, 4, 4);
    // right = -y, up = +z, back = -x
    expect_cube(read_camera_path(folder.put("camera_path.json", R"({"camera_type":"perspective","render_height":8,
        "render_width":8,"seconds":1,"fps":24,"keyframes":[],"crop":null,"camera_path":[{"fov":90,"aspect":1,
        "camera_to_world":[0,0,-1,0, -1,0,0,0, 0,1,0,0, 0,0,0,1]}]})"),
                                 kView),
                4, 4, 4);
    // of COLMAP's format.rst, but for the pose: world to camera
    std::filesystem::create_directory(folder / "sparse");
    folder.put("sparse/cameras.txt", "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, "
                                     "HEIGHT, PARAMS[]\n# Number of cameras: 2\n3 SIMPLE_PINHOLE 8 8 4 4 4\n"
                                     "1 PINHOLE 10 10 7 7 5 5\n");
    folder.put("sparse/images.txt",
               "# Image list with two lines of data per image:\n2 0.5 0.5 -0.5 0.5 0 0 0 3 P1180141.JPG\n"
               "2362.39 248.498 58396 1784.7 268.254 59027 1784.7 268.254 -1\n1 1 0 0 0 5 6 7 1 P1180142.JPG\n\n");
    const auto colmap = read_camera_path(folder / "sparse", kView);
    expect_cube(colmap, 4, 4, 4);
    ASSERT_EQ(colmap->frames.size(), 2u);
    EXPECT_EQ(colmap->frames[1].intrinsics, (Intrinsics{7, 7, 5, 5, 10, 10}));
    EXPECT_EQ(colmap->frames[1].pose.world_to_camera[7], 6);
    EXPECT_EQ(colmap->frames[1].time, 1);
}

TEST(CameraFiles, kitti_takes_times_and_calibration_from_beside_the_poses)
{
    const ScratchFolder folder;
    const std::string pose = "1 0 0 0 0 1 0 0 0 0 1 0\n";
    folder.put("times.txt", "0.000000e+00\n1.037223e-01\n");
    folder.put("calib.txt", "P0: 7.188560e+02 0 6.071928e+02 0 0 7.188560e+02 1.852157e+02 0 0 0 1 0\nTr: 1 2 3\n");
    const auto path = read_camera_path(folder.put("00.txt", pose + pose), pinhole_from_fov(90, 1241, 376));
    ASSERT_TRUE(path) << path.error().message;
    EXPECT_DOUBLE_EQ(path->frames[1].time, 0.1037223);
    expect_near(path->frames[1].intrinsics, {718.856, 718.856, 607.6928, 185.7157, 1241, 376}, 1e-9); // + 0.5
    const auto read = [&](const char* name, std::string_view text) {
        return read_kitti(folder / "00.txt", pinhole_from_fov(90, 1241, 376),
                          name[0] == 't' ? KittiFiles{folder.put("t", text), {}}
                                         : KittiFiles{{}, folder.put("c", text)});
    };
    EXPECT_TRUE(says(read_kitti(folder / "00.txt", kView, {{}, folder / "calib.txt"}),
                     "far from the middle of 616 x 424 pixels; give the size of the calibrated pictures"));
    EXPECT_TRUE(says(read("t", "0\n"), "expected a time for each of the 2 poses, found 1"));
    EXPECT_TRUE(says(read("t", "0 1\n1\n"), "line 1: expected one time in seconds, found '0 1'"));
    EXPECT_TRUE(says(read("t", "0\nnan\n"), "line 2: expected one time in seconds, found 'nan'"));
    EXPECT_TRUE(says(read("t", "0\nx\n"), "line 2: expected a number, found 'x'"));
    EXPECT_TRUE(says(read("c", "P1: 1 0 1\n"), "no line P0: with the projection"));
    EXPECT_TRUE(says(read("c", "P0: 1 0 1\n"), "P0: expected 12 numbers, found 3"));
    EXPECT_TRUE(says(read("c", "P0: 1 0 1 0 0 1 1 0 0 0 1 0 9\n"), "P0: expected 12 numbers, found more"));
    EXPECT_TRUE(says(read("c", "P0: 1 0.1 1 0 0 1 1 0 0 0 1 0\n"), "expected a projection without skew"));
    EXPECT_TRUE(says(read("c", "P0: -1 0 600 0 0 1 180 0 0 0 1 0\n"), "expected focal lengths above 0"));
    EXPECT_TRUE(says(read_kitti(folder / "00.txt", kView, {folder / "none", {}}), "No such file"));
}

TEST(CameraFiles, a_broken_kitti_file_is_named)
{
    const ScratchFolder folder;
    const auto read = [&](std::string_view text) { return read_kitti(folder.put("poses.txt", text), kView); };
    EXPECT_TRUE(says(read(""), "a trajectory without poses"));
    EXPECT_TRUE(says(read("\n\n# nothing\n"), "a trajectory without poses"));
    EXPECT_TRUE(
        says(read("1 0 0 0 0 1 0 0 0 0 1\n"), "poses.txt' line 1: expected the 12 numbers of a 3x4 matrix, found 11"));
    EXPECT_TRUE(says(read("1 0 0 0 0 1 0 0 0 0 1 0 0\n"), "found more"));
    EXPECT_TRUE(
        says(read("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 z\n"), "line 2: expected a number, found 'z'"));
    EXPECT_TRUE(says(read("1 0 0 nan 0 1 0 0 0 0 1 0\n"), "a matrix with a number that is not finite"));
    EXPECT_TRUE(says(read("2 0 0 0 0 2 0 0 0 0 2 0\n"), "expected a rotation without scale or mirror"));
    EXPECT_TRUE(says(read("-1 0 0 0 0 1 0 0 0 0 1 0\n"), "mirrored"));
    EXPECT_TRUE(says(read("0 0 0 0 0 0 0 0 0 0 0 0\n"), "expected a rotation"));
    EXPECT_TRUE(says(read("1 0 0 1e999 0 1 0 0 0 0 1 0\n"), "expected a number, found '1e999'"));
    EXPECT_TRUE(says(read_kitti(folder / "none", kView), "No such file"));
    EXPECT_TRUE(says(read_kitti(folder.put("p", "1 0 0 0 0 1 0 0 0 0 1 0"), {}), "an image of 0 x 0 pixels"));
    EXPECT_TRUE(says(read(std::string((16u << 20) + 1, '\n')), "expected at most 16777216 bytes"));
}

TEST(CameraFiles, a_broken_camera_path_is_named)
{
    const ScratchFolder folder;
    const auto whole = [&](std::string_view text) { return read_camera_path_json(folder.put("a.json", text)); };
    const auto read = [&](const std::string& file, const std::string& frame) {
        return whole(fmt::format(R"({{{}"camera_path":[{{{}}}]}})", file, frame));
    };
    const std::string size = R"("render_width":8,"render_height":6,)";
    const std::string pose = R"("camera_to_world":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],)";
    EXPECT_TRUE(read(size, pose + R"("fov":50)"));
    EXPECT_TRUE(says(whole("[]"), "expected an object with an array camera_path"));
    EXPECT_TRUE(says(whole(R"({"camera_path":5})"), "expected an object with an array camera_path"));
    EXPECT_TRUE(says(whole(R"({"camera_path":[]})"), "a trajectory without poses, camera_path is empty"));
    EXPECT_TRUE(says(whole(R"({"camera_path":[)"), "a.json"));
    EXPECT_TRUE(says(read("", pose + R"("fov":50)"), "render_width is missing"));
    EXPECT_TRUE(says(read(R"("render_width":8,)", pose + R"("fov":50)"), "render_height is missing"));
    EXPECT_TRUE(says(read(R"("render_width":8,"render_height":0,)", pose + R"("fov":50)"),
                     "render_height: expected an image size"));
    EXPECT_TRUE(says(read(size + R"("camera_type":"vr180",)", pose + R"("fov":50)"),
                     "camera_type: expected perspective, fisheye or equirectangular, found '\"vr180\"'"));
    EXPECT_TRUE(says(read(size, R"("fov":50)"), "frame 0: expected an object with a camera_to_world"));
    EXPECT_TRUE(
        says(read(size, R"("camera_to_world":[1,0,0],"fov":50)"), "expected a 4x4 or 3x4 matrix, found 3 numbers"));
    EXPECT_TRUE(
        says(read(size, R"("camera_to_world":[3,0,0,0,0,3,0,0,0,0,3,0,0,0,0,1],"fov":50)"), "expected a rotation"));
    EXPECT_TRUE(says(read(size, R"("camera_to_world":"x","fov":50)"), "expected an array of numbers, found string"));
    EXPECT_TRUE(says(read(size, pose + R"("aspect":1)"), "frame 0: fov is missing"));
    EXPECT_TRUE(says(read(size, pose + R"("fov":180)"), "expected a fov above 0 and below 180 degrees, found 180"));
    EXPECT_TRUE(says(read(size, pose + R"("fov":"wide")"), "fov: expected a number, found string"));
    EXPECT_TRUE(says(read(size + R"("fps":0,)", pose + R"("fov":50)"), "expected fps above 0, found 0"));
    EXPECT_TRUE(says(read(size, pose + R"("fov":50,"render_time":"x")"), "render_time: expected a number"));
    EXPECT_TRUE(says(read_camera_path_json(folder / "none.json"), "No such file"));
    EXPECT_EQ(read(size + R"("camera_type":"equirectangular",)", pose + R"("fov":50)")->frames[0].intrinsics,
              whole_sphere(8, 6));
    const auto timed = whole(R"({"fps":10,"render_width":8,"render_height":6,"camera_path":[{)" + pose +
                             R"("fov":50},{)" + pose + R"("fov":40}]})");
    EXPECT_DOUBLE_EQ(timed->frames[1].time, 0.1);
    EXPECT_NEAR(timed->frames[1].intrinsics.fy, 3 / std::tan(20 * std::numbers::pi / 180), 1e-12);
}

TEST(CameraFiles, a_camera_path_is_not_written_for_what_it_has_no_place_for)
{
    const ScratchFolder folder;
    const auto write = [&](const CameraPath& path) { return write_camera_path_json(folder / "a.json", path); };
    Intrinsics k = kView;
    k.cx += 1;
    EXPECT_TRUE(says(write(random_path(1, k)), "with square pixels and the centre in the middle"));
    k = kView;
    k.fy *= 1.1;
    EXPECT_TRUE(says(write(random_path(1, k)), "with square pixels"));
    k = kView;
    k.model = CameraModel::opencv;
    k.distortion[0] = 0.1;
    EXPECT_TRUE(says(write(random_path(1, k)), "frame 0 has lens distortion"));
    CameraPath sizes = random_path(2);
    sizes.frames[1].intrinsics = pinhole_from_fov(90, 10, 10);
    EXPECT_TRUE(says(write(sizes), "frame 1 has another camera model or size than the first"));
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(CameraFiles, a_broken_colmap_folder_is_named)
{
    const ScratchFolder folder;
    const auto read = [&](std::string_view cameras, std::string_view images) {
        folder.put("cameras.txt", cameras);
        folder.put("images.txt", images);
        return read_colmap(folder.path());
    };
    const std::string good = "1 PINHOLE 8 6 4 4 4 3\n", image = "1 1 0 0 0 0 0 0 1 a.png\n\n";
    EXPECT_TRUE(read(good, image));
    EXPECT_TRUE(read(good, "# c\n\n1 1 0 0 0 0 0 0 1 a.png")); // the last line of points may be missing
    EXPECT_TRUE(says(read("", image), "cameras.txt': no cameras"));
    EXPECT_TRUE(says(read("1 PINHOLE 8 6\n", image),
                     "cameras.txt' line 1: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, found 4 words"));
    EXPECT_TRUE(says(read("1 EUCM 8 6 4 4 4 3 1 1\n", image),
                     "camera model 'EUCM' is not supported, expected one of SIMPLE_PINHOLE, PINHOLE"));
    EXPECT_TRUE(says(read("1 THIN_PRISM_FISHEYE 8 6 4 4 4 3 .1 0 .2 0 0 0 0 0\n", image),
                     "with p1, p2, sx1 or sy1 other than 0, which is not supported"));
    EXPECT_TRUE(says(read("1 FOV 8 6 4 4 4 3 2.5\n", image), "that does not see the image's corners"));
    EXPECT_TRUE(says(read("1 FOV 8000 6000 2000 2000 4000 3000 0.62\n", image), "pixels away from it, at most 0.05"));
    EXPECT_TRUE(says(read("1 PINHOLE 8 6 4 4 3\n", image), "expected 4 parameters of PINHOLE, found 3"));
    EXPECT_TRUE(says(read("1 OPENCV 8 6 4 4 4 3 0.1\n", image), "expected 8 parameters of OPENCV, found 5"));
    EXPECT_TRUE(says(read("1 PINHOLE 8 0 4 4 4 3\n", image), "height: expected an image size"));
    EXPECT_TRUE(says(read("1 PINHOLE 8 6 0 4 4 3\n", image), "expected focal lengths above 0"));
    EXPECT_TRUE(says(read("1 PINHOLE 8 6 x 4 4 3\n", image), "expected a number, found 'x'"));
    EXPECT_TRUE(says(read("1 EQUIRECTANGULAR 8 4 16 8\n", image), "a panorama of 16 x 8 in a picture of 8 x 4"));
    EXPECT_TRUE(says(read(good + good, image), "line 2: a second camera '1'"));
    EXPECT_TRUE(says(read(good, ""), "images.txt': a trajectory without poses"));
    EXPECT_TRUE(says(read(good, "1 1 0 0 0 0 0 0 1\n"), "images.txt' line 1: expected the 10 words IMAGE_ID QW"));
    EXPECT_TRUE(says(read(good, "1 1 0 0 0 0 0 0 2 a.png\n"), "no camera '2' in cameras.txt"));
    EXPECT_TRUE(says(read(good, "1 2 0 0 0 0 0 0 1 a.png\n"),
                     "expected a quaternion of norm 1, found 2; the order is w x y z"));
    EXPECT_TRUE(says(read(good, "1 1 0 0 0 nan 0 0 1 a.png\n"), "a number that is not finite"));
    EXPECT_TRUE(says(read(good, "1 nan 0 0 0 0 0 0 1 a.png\n"), "a number that is not finite"));
    EXPECT_TRUE(says(read(good, "1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n"),
                     "line 2: expected the points of the picture (X Y POINT3D_ID each; the line may be empty)"));
    std::filesystem::remove(folder / "images.txt");
    EXPECT_TRUE(says(read_colmap(folder.path()), "No such file"));
    std::filesystem::remove(folder / "cameras.txt");
    EXPECT_TRUE(says(read_colmap(folder.path()), "No such file"));
    EXPECT_TRUE(says(read_camera_path(folder.path(), kView), "or a folder: COLMAP's (cameras.bin or cameras.txt"));
}

// COLMAP's binary files, written by hand from the description of its format
class BinaryModel {
  public:
    template <typename T>
    BinaryModel& put(T value)
    {
        bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
        return *this;
    }
    BinaryModel& camera(uint32_t id, uint32_t model, uint64_t width, uint64_t height, const std::vector<double>& params)
    {
        put(id).put(model).put(width).put(height);
        for (const double p : params)
            put(p);
        return *this;
    }
    BinaryModel& image(uint32_t id, const std::array<double, 7>& pose, uint32_t camera, std::string_view name,
                       uint64_t points)
    {
        put(id);
        for (const double p : pose)
            put(p);
        put(camera);
        bytes.append(name).push_back('\0');
        put(points);
        for (uint64_t i = 0; i < points; ++i)
            put(1.5).put(2.5).put(~uint64_t(0));
        return *this;
    }
    std::string bytes;
};

TEST(CameraFiles, colmaps_binary_model_is_read_like_its_text)
{
    const ScratchFolder folder;
    std::filesystem::create_directory(folder / "text");
    std::filesystem::create_directory(folder / "binary");
    folder.put("text/cameras.txt", "7 SIMPLE_RADIAL 8 6 4 4 3 0.1\n2 PINHOLE 10 12 7 8 5 6\n"
                                   "9 FULL_OPENCV 8 6 4 5 4 3 .1 .2 .01 .02 .3 .4 .5 .6\n"
                                   "4 OPENCV_FISHEYE 8 6 4 5 4 3 .1 .2 .03 .04\n3 EQUIRECTANGULAR 8 4 8 4\n");
    folder.put("text/images.txt",
               "5 0.5 0.5 -0.5 0.5 1 2 3 7 front/b.png\n1 2 -1 3 4 8\n6 1 0 0 0 0 0 0 2 front/a.png\n\n"
               "7 1 0 0 0 0 0 9 9 front/c.png\n\n8 1 0 0 0 0 0 8 4 left/d.png\n\n"
               "9 1 0 0 0 0 0 7 3 left/e.png\n\n");
    const std::string cameras = BinaryModel()
                                    .put(uint64_t(5))
                                    .camera(7, 2, 8, 6, {4, 4, 3, 0.1})
                                    .camera(2, 1, 10, 12, {7, 8, 5, 6})
                                    .camera(9, 6, 8, 6, {4, 5, 4, 3, .1, .2, .01, .02, .3, .4, .5, .6})
                                    .camera(4, 5, 8, 6, {4, 5, 4, 3, .1, .2, .03, .04})
                                    .camera(3, 17, 8, 4, {8, 4})
                                    .bytes;
    const std::string images = BinaryModel()
                                   .put(uint64_t(5))
                                   .image(5, {0.5, 0.5, -0.5, 0.5, 1, 2, 3}, 7, "front/b.png", 2)
                                   .image(6, {1, 0, 0, 0, 0, 0, 0}, 2, "front/a.png", 0)
                                   .image(7, {1, 0, 0, 0, 0, 0, 9}, 9, "front/c.png", 1)
                                   .image(8, {1, 0, 0, 0, 0, 0, 8}, 4, "left/d.png", 0)
                                   .image(9, {1, 0, 0, 0, 0, 0, 7}, 3, "left/e.png", 0)
                                   .bytes;
    folder.put("binary/cameras.bin", cameras);
    folder.put("binary/images.bin", images);
    const auto text = read_camera_path(folder / "text", kView), binary = read_camera_path(folder / "binary", kView);
    ASSERT_TRUE(text) << text.error().message;
    ASSERT_TRUE(binary) << binary.error().message;
    ASSERT_EQ(binary->frames.size(), 5u);
    for (size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(binary->frames[i].camera, text->frames[i].camera);
        EXPECT_EQ(binary->frames[i].time, text->frames[i].time);
        EXPECT_EQ(binary->frames[i].pose.world_to_camera, text->frames[i].pose.world_to_camera);
        EXPECT_EQ(binary->frames[i].intrinsics, text->frames[i].intrinsics);
    }
    for (size_t bytes = 0; bytes < cameras.size(); ++bytes) {
        folder.put("binary/cameras.bin", cameras.substr(0, bytes));
        EXPECT_FALSE(read_colmap(folder / "binary")) << bytes;
    }
    folder.put("binary/cameras.bin", cameras);
    for (size_t bytes = 0; bytes < images.size(); ++bytes) {
        folder.put("binary/images.bin", images.substr(0, bytes));
        EXPECT_FALSE(read_colmap(folder / "binary")) << bytes;
    }
    EXPECT_TRUE(says(write_colmap(folder / "binary", *text), "holds a binary model"));
}

TEST(CameraFiles, a_broken_binary_model_is_named)
{
    const ScratchFolder folder;
    const auto read = [&](const BinaryModel& cameras, const BinaryModel& images) {
        folder.put("cameras.bin", cameras.bytes);
        folder.put("images.bin", images.bytes);
        return read_colmap(folder.path());
    };
    const BinaryModel good = BinaryModel().put(uint64_t(1)).camera(1, 1, 8, 6, {4, 4, 4, 3});
    const std::array<double, 7> pose = {1, 0, 0, 0, 0, 0, 0};
    const BinaryModel image = BinaryModel().put(uint64_t(1)).image(1, pose, 1, "a.png", 0);
    EXPECT_TRUE(read(good, image));
    EXPECT_TRUE(says(read(BinaryModel().put(uint64_t(0)), image), "cameras.bin': no cameras"));
    EXPECT_TRUE(says(read(BinaryModel().put(~uint64_t(0)).camera(1, 1, 8, 6, {4, 4, 4, 3}), image),
                     "camera 1 at byte 64: the file ends, expected 18446744073709551615 cameras"));
    EXPECT_TRUE(says(read(BinaryModel().put(uint64_t(1)).camera(1, 16, 8, 6, {4, 4, 4, 3, 1, 1}), image),
                     "camera 0 at byte 8: camera model number 16 is not supported"));
    EXPECT_TRUE(says(read(BinaryModel().put(uint64_t(1)).camera(1, 1, ~0ull, 6, {4, 4, 4, 3}), image),
                     "width: expected an image size"));
    EXPECT_TRUE(says(read(BinaryModel(good).put(uint8_t(1)), image), "1 bytes follow the last camera"));
    EXPECT_TRUE(
        says(read(good, BinaryModel().put(uint64_t(1)).image(1, pose, 2, "a.png", 0)), "no camera 2 in cameras.bin"));
    EXPECT_TRUE(says(read(good, BinaryModel().put(uint64_t(1)).image(1, {2, 0, 0, 0, 0, 0, 0}, 1, "a.png", 0)),
                     "image 0 at byte 8: expected a quaternion of norm 1, found 2"));
    EXPECT_TRUE(says(read(good, BinaryModel().put(uint64_t(1)).image(1, {1, 0, 0, 0, NAN, 0, 0}, 1, "a.png", 0)),
                     "not finite"));
    EXPECT_TRUE(says(read(good, BinaryModel().put(uint64_t(0))), "images.bin': a trajectory without poses"));
    EXPECT_TRUE(says(read(good, BinaryModel().put(uint64_t(1)).image(1, pose, 1, std::string(5000, 'a'), 0)),
                     "a name of more than 4096 bytes"));
    BinaryModel points = image; // says it has 2^61 points
    points.bytes.replace(points.bytes.size() - 8, 8, std::string("\0\0\0\0\0\0\0\x20", 8));
    EXPECT_TRUE(says(read(good, points), "ends within a picture of 2305843009213693952 points"));
}

// against the formulas of the description: theta = atan(r), and a radius of atan(2 r tan(omega / 2)) / omega
TEST(CameraFiles, colmaps_fisheyes_become_ours)
{
    const ScratchFolder folder;
    const auto lens = [&](const std::string& line) {
        folder.put("cameras.txt", "1 " + line + "\n");
        folder.put("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n");
        const auto path = read_colmap(folder.path());
        EXPECT_TRUE(path) << path.error().message;
        return path ? path->frames[0].intrinsics : Intrinsics{};
    };
    EXPECT_EQ(lens("SIMPLE_RADIAL_FISHEYE 80 60 40 40 30 0.1"),
              (Intrinsics{40, 40, 40, 30, 80, 60, CameraModel::fisheye, {0.1}}));
    EXPECT_EQ(lens("RADIAL_FISHEYE 80 60 40 40 30 0.1 0.02"),
              (Intrinsics{40, 40, 40, 30, 80, 60, CameraModel::fisheye, {0.1, 0.02}}));
    EXPECT_EQ(lens("FISHEYE 80 60 40 41 40 30"), (Intrinsics{40, 41, 40, 30, 80, 60, CameraModel::fisheye}));
    EXPECT_EQ(lens("THIN_PRISM_FISHEYE 80 60 40 41 40 30 0.1 0.02 0 0 0.003 0.004 0 0"),
              (Intrinsics{40, 41, 40, 30, 80, 60, CameraModel::fisheye, {0.1, 0.02, 0.003, 0.004}}));
    // Project Tango's fisheye
    const double fx = 256.3, fy = 255.9, cx = 318.1, cy = 241.7, omega = 0.92;
    const Lens ours(lens("FOV 640 480 256.3 255.9 318.1 241.7 0.92"));
    double worst = 0;
    for (double x = 0; x <= 640; x += 16)
        for (double y = 0; y <= 480; y += 16) {
            const double a = (x - cx) / fx, b = (y - cy) / fy, radius = std::hypot(a, b);
            const double away = std::tan(radius * omega) / (2 * std::tan(omega / 2)),
                         scale = radius > 0 ? away / radius : 1;
            const auto seen = ours.project({a * scale, b * scale, 1});
            ASSERT_TRUE(seen) << x << " " << y;
            worst = std::max(worst, std::hypot(seen->x - x, seen->y - y));
        }
    EXPECT_LT(worst, 0.05);
}

TEST(CameraFiles, pictures_of_colmap_give_order_and_cameras)
{
    const ScratchFolder folder;
    folder.put("cameras.txt",
               "1 SIMPLE_RADIAL 8 6 4 4 3 0.1\n2 RADIAL 8 6 4 4 3 0.1 0.2\n7 OPENCV 8 6 4 5 4 3 0 0 0 0\n");
    folder.put(
        "images.txt",
        "1 1 0 0 0 0 0 0 1 images/b.png\n\n5 1 0 0 0 9 0 0 2 images/a.png\n\n6 1 0 0 0 0 0 0 7 images/c.png\n\n");
    const auto path = read_colmap(folder.path());
    ASSERT_TRUE(path) << path.error().message;
    EXPECT_EQ(path->frames[0].pose.world_to_camera[3], 9); // a.png
    EXPECT_EQ(path->frames[0].camera, "");
    EXPECT_EQ(path->frames[0].intrinsics, (Intrinsics{4, 4, 4, 3, 8, 6, CameraModel::opencv, {0.1, 0.2}}));
    EXPECT_EQ(path->frames[1].intrinsics, (Intrinsics{4, 4, 4, 3, 8, 6, CameraModel::opencv, {0.1}}));
    EXPECT_EQ(path->frames[2].intrinsics, (Intrinsics{4, 5, 4, 3, 8, 6})); // without distortion
    folder.put("images.txt",
               "1 1 0 0 0 0 0 0 1 left/1.png\n\n5 1 0 0 0 9 0 0 1 front/1.png\n\n6 1 0 0 0 0 0 0 1 front/2.png\n\n");
    const auto rig = read_colmap(folder.path());
    EXPECT_EQ(rig->frames[0].camera, "front");
    EXPECT_EQ(rig->frames[1].camera, "left");
    EXPECT_EQ(rig->frames[1].time, 0);
    EXPECT_EQ(rig->frames[2].camera, "front");
    EXPECT_EQ(rig->frames[2].time, 1);
}

TEST(CameraFiles, a_transforms_file_has_at_the_top_what_all_frames_share)
{
    const ScratchFolder folder;
    const auto written = [&](const std::vector<Intrinsics>& views) {
        CameraPath path;
        for (const Intrinsics& k : views)
            path.frames.emplace_back().intrinsics = k;
        EXPECT_TRUE(write_transforms(folder / "t.json", path));
        const auto read = read_transforms(folder / "t.json");
        EXPECT_TRUE(read) << read.error().message;
        for (size_t i = 0; i < path.frames.size(); ++i)
            expect_near(read->frames[i].intrinsics, path.frames[i].intrinsics, 1e-9);
        return *read_json(folder / "t.json");
    };
    const Intrinsics plain = pinhole_from_fov(60, 64, 40),
                     lens{50, 51, 31, 20, 64, 40, CameraModel::opencv, {0.1, 0.2}},
                     rational{50, 51, 31, 20, 64, 40, CameraModel::opencv, {0.1, 0, 0, 0, 0, 0.3}},
                     fisheye{20, 20, 32, 20, 64, 40, CameraModel::fisheye, {0.01}};
    const Json shared = written({lens, lens});
    EXPECT_EQ(shared["k2"], 0.2);
    EXPECT_FALSE(shared["frames"][0].contains("k2") || shared["frames"][0].contains("w"));
    for (const auto& [views, model] :
         {std::pair{std::vector{plain, lens}, "OPENCV"}, {std::vector{lens, rational}, "FULL_OPENCV"}}) {
        const Json file = written(views);
        EXPECT_EQ(file["camera_model"], model);
        for (const char* key : {"w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "p1", "p2"})
            EXPECT_FALSE(file.contains(key)) << key; // nerfstudio would take it for all frames
        EXPECT_EQ(file["frames"][1]["fl_y"], 51);
    }
    const Json mixed = written({lens, fisheye});
    EXPECT_FALSE(mixed.contains("camera_model"));
    EXPECT_EQ(mixed["frames"][1]["camera_model"], "OPENCV_FISHEYE");
}

TEST(CameraFiles, colmap_names_of_several_cameras_differ_at_their_end)
{
    const ScratchFolder folder;
    CameraPath path = random_path(4);
    for (size_t i = 0; i < 4; ++i)
        path.frames[i].camera = i % 2 ? "left" : "front";
    ASSERT_TRUE(write_colmap(folder / "rig", path));
    const std::string rig = contents(folder / "rig/images.txt");
    for (const char* name : {" front/front_000000.png\n", " left/left_000000.png\n", " left/left_000001.png\n"})
        EXPECT_NE(rig.find(name), std::string::npos) << name;
    for (CameraFrame& f : path.frames)
        f.camera.clear();
    ASSERT_TRUE(write_colmap(folder / "one", path));
    EXPECT_NE(contents(folder / "one/images.txt").find(" color/000003.png\n"), std::string::npos); // as `render` does
}

TEST(CameraFiles, formats_have_names)
{
    for (const PathFormat format :
         {PathFormat::tum, PathFormat::kitti, PathFormat::transforms, PathFormat::camera_path, PathFormat::colmap})
        EXPECT_EQ(path_format_of(name_of(format)), format);
    EXPECT_FALSE(path_format_of("carla"));
}

// a file of poses alone takes the lens that was asked for
TEST(CameraFiles, a_transforms_file_without_intrinsics_takes_a_lens)
{
    const ScratchFolder folder;
    const auto file =
        folder.put("a.json", R"({"frames":[{"transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})");
    for (const Intrinsics& k : {fisheye_from_fov(190, 60, 50), whole_sphere(60, 30), pinhole_from_fov(70, 60, 50)})
        EXPECT_EQ(read_camera_path(file, k)->frames[0].intrinsics, k);
}

} // namespace engine_camera_files_test
} // namespace semrover
