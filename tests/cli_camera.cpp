// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/camera_path.h"
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "tests/program.h"

#include <gtest/gtest.h>

namespace semrover {
namespace cli_camera_test {

namespace fs = std::filesystem;

const std::string kDrive = SEMROVER_SOURCE_DIR "/assets/scenes/street.tum";
const std::string kGrid = SEMROVER_SOURCE_DIR "/assets/scenes/street.truth.sgrid";

ProgramResult convert(const std::string& in, const Path& out, const std::string& more = "")
{
    return semrover_program("convert " + in + " " + out.string() + " " + more);
}

TEST(CliCamera, a_drive_goes_through_every_format_and_comes_back)
{
    const ScratchFolder folder;
    const std::string at = folder.path().string() + "/";
    ASSERT_EQ(convert(kDrive, at + "poses.txt", "-W 320 -H 200 --fov-x 60").code, 0);
    ASSERT_EQ(convert(at + "poses.txt", at + "camera_path.json").code, 0); // its lens is in calib.txt
    ASSERT_EQ(convert(at + "camera_path.json", at + "sparse/").code, 0);
    ASSERT_EQ(convert(at + "sparse", at + "transforms.json").code, 0);
    const ProgramResult last = convert(at + "transforms.json", at + "back.tum");
    ASSERT_EQ(last.code, 0) << last.err;
    EXPECT_EQ(last.out, "24 frames as tum, without intrinsics\n");
    const Intrinsics view = pinhole_from_fov(60, 320, 200);
    const auto first = read_tum(kDrive, view), now = read_camera_path(folder / "back.tum", view),
               lens = read_camera_path(folder / "transforms.json", pinhole_from_fov(10, 10, 10));
    ASSERT_EQ(now->frames.size(), 24u);
    for (size_t i = 0; i < 24; ++i) {
        for (size_t j = 0; j < 16; ++j)
            EXPECT_NEAR(now->frames[i].pose.world_to_camera[j], first->frames[i].pose.world_to_camera[j], 1e-6);
        EXPECT_NEAR(lens->frames[i].intrinsics.fx, view.fx, 1e-6);
    }
    EXPECT_EQ(folder.entries(), 7u); // with times.txt and calib.txt; nothing temporary is left
}

TEST(CliCamera, a_rig_becomes_one_file_or_a_file_of_one_camera)
{
    const ScratchFolder folder;
    const std::string rig = "--rig " SEMROVER_SOURCE_DIR "/assets/rigs/waymo.json";
    ASSERT_EQ(convert(kDrive, folder / "a.json", rig).code, 0);
    const auto path = read_transforms(folder / "a.json");
    ASSERT_TRUE(path) << path.error().message;
    EXPECT_EQ(path->frames.size(), 24u * 5);
    EXPECT_EQ(path->frames[3].camera, "side_left");
    EXPECT_EQ(path->frames[3].intrinsics.height, 886u);
    EXPECT_EQ(path->frames[3].intrinsics.model, CameraModel::opencv);
    ASSERT_EQ(convert((folder / "a.json").string(), folder / "b.tum", "--camera side_left").code, 0);
    EXPECT_EQ(read_tum(folder / "b.tum", pinhole_from_fov(60, 8, 8))->frames.size(), 24u);
    expect_error(convert((folder / "a.json").string(), folder / "c.tum"), 3,
                 "has the cameras front, front_left, front_right, side_left, side_right; a tum file holds one");
    expect_error(convert((folder / "a.json").string(), folder / "c.tum", "--camera top"), 3, "has no camera 'top'");
    EXPECT_FALSE(fs::exists(folder / "c.tum"));
}

TEST(CliCamera, what_cannot_be_converted_is_told_in_one_line)
{
    const ScratchFolder folder;
    expect_error(convert(kDrive, folder / "a.dat"), 2, "does not tell which format is meant");
    expect_error(convert(kDrive, kDrive), 2, "IN and OUT are the same");
    expect_error(convert(kDrive, folder.put("there.tum", "")), 2, "exists; -y replaces it");
    expect_error(convert(kDrive, folder / "there.tum", "--path-format colmap"), 3, "COLMAP's model is a folder");
    expect_error(convert((folder / "none.tum").string(), folder / "b.tum"), 3, "No such file");
    expect_error(convert(folder.put("bad.tum", "0 0 0 0 0 0 0 2").string(), folder / "b.tum"), 3,
                 "expected a quaternion of norm 1, found 2");
    expect_error(convert(folder.put("nan.txt", "nan 0 0 0 0 0 0 1").string(), folder / "b.tum"), 3, "not finite");
    expect_error(convert(kDrive, folder / "camera_path.json", "--camera-model opencv --distortion=0.1,0,0,0"), 3,
                 "frame 0 has lens distortion");
    expect_error(convert(kDrive, folder / "a.json", "--camera-model opencv --distortion=0.1,0"), 2,
                 "--distortion takes k1,k2,p1,p2");
    expect_error(convert(kDrive, folder / "a.json", "--camera-model fisheye --distortion=0.1,x,0,0"), 2,
                 "--distortion takes numbers");
    expect_error(convert(kDrive, folder / "a.json", "--fov-x 175"), 2, "a pinhole camera sees at most 170");
    EXPECT_EQ(folder.entries(), 3u); // what the test put there
    ASSERT_EQ(convert(kDrive, folder / "there.tum", "-y -q").code, 0);
}

ProgramResult render(const Path& out, const std::string& more)
{
    return semrover_program("render " + kGrid + " -q --splat-radius auto -o " + out.string() + " " + more);
}

TEST(CliCamera, render_draws_every_lens)
{
    const ScratchFolder folder;
    const std::string one = "--path " + folder.put("one.tum", "0 1 0 1.7 -0.5 0.5 -0.5 0.5\n").string();
    struct Case {
        const char *name, *options;
        ImageSize size;
    };
    const Case cases[] = {{"pinhole", "-W 60 -H 40", {60, 40}},
                          {"opencv", "-W 60 -H 40 --camera-model opencv --distortion=-0.2,0.05,0,0", {60, 40}},
                          {"fisheye", "-W 60 -H 60 --camera-model fisheye --fov-x 190", {60, 60}},
                          {"panorama", "-W 64 --equirect", {64, 32}}};
    for (const Case& c : cases) {
        const ProgramResult result = render(folder / c.name, one + " " + c.options);
        ASSERT_EQ(result.code, 0) << result.err;
        const auto color = read_png_rgb8(folder / c.name / "color/000000.png");
        ASSERT_TRUE(color) << color.error().message;
        EXPECT_EQ((ImageSize{color->width, color->height}), c.size) << c.name;
        const auto at = [&](uint32_t x, uint32_t y) { return color->pixels[(size_t(y) * color->width + x) * 3 + 1]; };
        EXPECT_GT(at(c.size.width / 2, c.size.height * 3 / 4), 20) << c.name; // the road
        EXPECT_EQ(at(c.size.width / 2, 0), 0) << c.name;                      // the sky
    }
    expect_error(render(folder / "x", one + " -W 61 --equirect"), 2, "61 is odd");
    expect_error(render(folder / "x", one + " --equirect --rig r.json"), 2, "--equirect or --rig");
    EXPECT_FALSE(fs::exists(folder / "x"));
}

std::vector<float> plane(const Path& file, ImageSize size)
{
    const std::string bytes = contents(file);
    const auto header = parse_npy_header(bytes, "plane");
    EXPECT_TRUE(header) << file;
    EXPECT_EQ(header->dtype, DType::f32);
    EXPECT_EQ(header->shape, (std::vector<uint64_t>{size.height, size.width}));
    std::vector<float> values(size_t(size.width) * size.height);
    EXPECT_EQ(bytes.size(), header->bytes + values.size() * 4);
    std::memcpy(values.data(), bytes.data() + header->bytes, values.size() * 4);
    return values;
}

TEST(CliCamera, render_writes_depth_as_numbers_and_where_it_is_visible)
{
    const ScratchFolder folder;
    const std::string one =
        "--path " + folder.put("one.tum", "0 1 0 1.7 -0.5 0.5 -0.5 0.5\n").string() + " -W 60 -H 40";
    const ProgramResult result = render(folder / "a", one + " --npy");
    ASSERT_EQ(result.code, 0) << result.err;
    ASSERT_EQ(render(folder / "b", one + " --visible-depth").code, 0);
    const auto expected = plane(folder / "a/depth_expected/000000.npy", {60, 40}),
               median = plane(folder / "a/depth_median/000000.npy", {60, 40}),
               alpha = plane(folder / "a/alpha/000000.npy", {60, 40});
    const auto depth = read_png_gray16(folder / "a/depth/000000.png"),
               masked = read_png_gray16(folder / "b/depth/000000.png");
    const auto visible = read_png_rgb8(folder / "a/visible/000000.png");
    ASSERT_TRUE(depth && masked && visible);
    size_t thin = 0, seen = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
        EXPECT_NEAR(expected[i] * 1000, depth->pixels[i], 0.51) << i; // the picture is the expected depth, rounded
        EXPECT_EQ(alpha[i] >= 0.5f, visible->pixels[3 * i] == 255) << i;
        EXPECT_EQ(masked->pixels[i], alpha[i] >= 0.5f ? depth->pixels[i] : 0) << i;
        EXPECT_EQ(median[i] > 0, alpha[i] > 0) << i;
        thin += alpha[i] > 0 && alpha[i] < 0.5f;
        seen += alpha[i] >= 0.5f;
    }
    EXPECT_GT(thin, 10u); // pixels that tell the two apart
    EXPECT_GT(seen, 500u);
    EXPECT_FALSE(fs::exists(folder / "b/alpha"));
}

TEST(CliCamera, kitti_keeps_times_and_lens)
{
    const ScratchFolder folder;
    const Path drive = folder.put("a.tum", "0.5 1 0 1.7 -0.5 0.5 -0.5 0.5\n0.75 2 0 1.7 -0.5 0.5 -0.5 0.5\n");
    const ProgramResult out = convert(drive.string(), folder / "poses.txt", "-W 620 -H 188 --fov-x 80");
    ASSERT_EQ(out.code, 0) << out.err;
    EXPECT_EQ(out.out, "2 frames as kitti, with times.txt and calib.txt beside them\n");
    EXPECT_EQ(contents(folder / "times.txt"), "0.5\n0.75\n");
    // read without a size: the file has it. A folder is a path, too
    ASSERT_EQ(convert(folder.path().string(), folder / "transforms.json").code, 0);
    const auto path = read_transforms(folder / "transforms.json");
    ASSERT_TRUE(path) << path.error().message;
    EXPECT_EQ(path->frames[1].time, 0.75);
    const Intrinsics view = pinhole_from_fov(80, 620, 188);
    EXPECT_NEAR(path->frames[0].intrinsics.fx, view.fx, 1e-9);
    EXPECT_NEAR(path->frames[0].intrinsics.cx, view.cx, 1e-9);
    EXPECT_EQ(path->frames[0].intrinsics.width, 620u);
    // odometry's own calibration says no size: it has to be given
    folder.put("calib.txt", "P0: 718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0\n");
    expect_error(convert((folder / "poses.txt").string(), folder / "b.json"), 3,
                 "calib.txt': has no size of the pictures (S_rect_00); give it with -W and -H");
    EXPECT_EQ(convert((folder / "poses.txt").string(), folder / "b.json", "-W 1241 -H 376").code, 0);
    expect_error(convert(drive.string(), folder / "c.kitti"), 2, "times.txt' exists; -y replaces it");
    fs::create_directory(folder / "empty");
    expect_error(semrover_program("render " + kGrid + " --path " + (folder / "empty").string() + " -o " +
                                  (folder / "r").string()),
                 3, "is a folder without files; expected a camera path");
}

TEST(CliCamera, render_draws_a_rig_of_several_lenses)
{
    const ScratchFolder folder;
    const auto rig = folder.put("rig.json", R"({"sensors":[
        {"name":"wide","model":"fisheye","width":48,"height":40,"fov":180,
         "sensor_to_vehicle":{"rotation":[-0.5,0.5,-0.5,0.5]}},
        {"name":"tele","width":48,"height":40,"fov":30,"sensor_to_vehicle":{"rotation":[-0.5,0.5,-0.5,0.5]}},
        {"name":"round","model":"equirectangular","width":64,"height":32,
         "sensor_to_vehicle":{"rotation":[-0.5,0.5,-0.5,0.5]}}]})");
    const auto drive = folder.put("two.tum", "0 1 0 1.7 -0.5 0.5 -0.5 0.5\n1 2 0 1.7 -0.5 0.5 -0.5 0.5\n");
    const ProgramResult result = render(folder / "out", "--path " + drive.string() + " --rig " + rig.string());
    ASSERT_EQ(result.code, 0) << result.err;
    for (const char* name : {"wide", "tele", "round"})
        for (const char* kind : {"color", "depth", "normal", "label", "visible"})
            EXPECT_TRUE(fs::exists(folder / "out" / name / kind / "000001.png")) << name << " " << kind;
}

} // namespace cli_camera_test
} // namespace semrover
