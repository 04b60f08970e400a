// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/camera/rig.h"
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "engine/scene/grid.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <gtest/gtest.h>
#include <map>
#include <set>
#include <sstream>
#include <sys/stat.h>

namespace semrover {
namespace cli_camera_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

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
    expect_error(convert(kDrive, folder / "a.dat"), 2, "does not show which format is meant");
    expect_error(convert(kDrive, kDrive), 2, "IN and OUT are the same");
    expect_error(convert(kDrive, folder.put("there.tum", "")), 2, "exists; -y replaces it");
    expect_error(convert(kDrive, folder / "there.tum", "--path-format colmap"), 3, "is a file; a folder is needed");
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
                 3, "is a folder without files; expected a trajectory");
}

// two poses, and a rig of three cameras of which two differ in size, two in focal length and one has a lens
struct RigDrive {
    ScratchFolder folder;
    std::string options;

    RigDrive()
    {
        const std::string ahead = R"("sensor_to_vehicle":{"rotation":[-0.5,0.5,-0.5,0.5]})";
        const Path rig =
            folder.put("rig.json", R"({"sensors":[{"name":"front","width":64,"height":40,"fov":90,)" + ahead +
                                       R"(},{"name":"tele","width":48,"height":48,"fov":40,)" + ahead +
                                       R"(},{"name":"lens","width":64,"height":40,"fov":90,"model":"opencv",)" +
                                       R"("distortion":[-0.2,0.05,0.01,0],)" + ahead + "}]}");
        const Path drive = folder.put("two.tum", "3 1 0 1.7 -0.5 0.5 -0.5 0.5\n4.5 2 0 1.7 -0.5 0.5 -0.5 0.5\n");
        options = "--path " + drive.string() + " --rig " + rig.string() + " ";
    }
};

// what nerfstudio's parser takes: the file's value for every frame, where there is one
Json nerfstudio_value(const Json& file, const Json& frame, const char* key)
{
    return file.contains(key) ? file[key] : frame.value(key, Json(0.0));
}

TEST(CliCamera, render_says_its_cameras_and_other_programs_read_them_right)
{
    const RigDrive d;
    const ProgramResult result = render(d.folder / "out", d.options + "--points");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json file = json_of(contents(d.folder / "out/transforms.json"));
    ASSERT_EQ(file["frames"].size(), 6u);
    const Rig rig = *read_rig(d.folder / "rig.json");
    for (size_t i = 0; i < 6; ++i) {
        const Json& frame = file["frames"][i];
        const Intrinsics& k = rig.sensors[i % 3].intrinsics;
        EXPECT_EQ(nerfstudio_value(file, frame, "w"), k.width);
        EXPECT_EQ(nerfstudio_value(file, frame, "h"), k.height);
        EXPECT_EQ(nerfstudio_value(file, frame, "fl_x"), k.fx);
        EXPECT_EQ(nerfstudio_value(file, frame, "cy"), k.cy);
        EXPECT_EQ(nerfstudio_value(file, frame, "k1"), k.distortion[0]);
        EXPECT_EQ(nerfstudio_value(file, frame, "p1"), k.distortion[2]);
        EXPECT_EQ(frame["camera"], rig.sensors[i % 3].name);
        EXPECT_EQ(frame["time"], i < 3 ? 3 : 4.5);
        EXPECT_EQ(frame["transform_matrix"][0][3], i < 3 ? 1 : 2); // in the grid's frame
        for (const char* key : {"file_path", "depth_file_path", "label_file_path"})
            EXPECT_TRUE(fs::exists(d.folder / "out" / frame[key].get<std::string>())) << frame[key];
    }
    EXPECT_EQ(file["camera_model"], "OPENCV");
    EXPECT_EQ(file["depth_unit_scale_factor"], 0.001);
    EXPECT_EQ(file["ply_file_path"], "points.ply");
    EXPECT_TRUE(fs::exists(d.folder / "out/points.ply"));
    const auto sensors = read_rig(d.folder.put("again.json", file["rig"].dump()));
    ASSERT_TRUE(sensors) << sensors.error().message;
    for (size_t i = 0; i < 3; ++i)
        EXPECT_EQ(sensors->sensors[i].intrinsics, rig.sensors[i].intrinsics);
    // one view: nerfstudio takes it from the top
    ASSERT_EQ(render(d.folder / "one", "--path " + (d.folder / "two.tum").string() + " -W 64 -H 40").code, 0);
    const Json one = json_of(contents(d.folder / "one/transforms.json"));
    EXPECT_NEAR(one["fl_x"].get<double>(), pinhole_from_fov(73, 64, 40).fx, 1e-12);
    EXPECT_FALSE(one["frames"][0].contains("fl_x"));
}

TEST(CliCamera, a_rig_is_drawn_at_another_size_and_sees_the_same)
{
    const RigDrive d;
    ASSERT_EQ(render(d.folder / "wide", d.options + "-W 32").code, 0);
    ASSERT_EQ(render(d.folder / "both", d.options + "-W 40 -H 20").code, 0);
    EXPECT_EQ(*read_image_size(d.folder / "wide/front/color/000000.png"), (ImageSize{32, 20})); // as it was: 64 x 40
    EXPECT_EQ(*read_image_size(d.folder / "wide/tele/color/000000.png"), (ImageSize{32, 32}));
    EXPECT_EQ(*read_image_size(d.folder / "both/tele/color/000001.png"), (ImageSize{40, 20}));
    const auto path = read_transforms(d.folder / "both/transforms.json");
    const Intrinsics tele = (*read_rig(d.folder / "rig.json")).sensors[1].intrinsics;
    EXPECT_EQ(path->frames[1].intrinsics, scaled_to(tele, 40, 20));
    // cameras that a path brings along, too; one without a size takes it
    ASSERT_EQ(convert((d.folder / "both/transforms.json").string(), d.folder / "c.json", "-H 40").code, 0);
    EXPECT_EQ(read_transforms(d.folder / "c.json")->frames[0].intrinsics,
              scaled_to(path->frames[0].intrinsics, 80, 40));
    for (const char* lens : {"--fov-x 60", "--camera-model fisheye", "--camera-model opencv --distortion=0.1,0,0,0"}) {
        expect_error(render(d.folder / "x", d.options + lens), 2, "rig.json' has lenses of its own");
        expect_error(convert((d.folder / "both/transforms.json").string(), d.folder / "x.json", lens), 2,
                     "transforms.json' has lenses of its own");
    }
    EXPECT_FALSE(fs::exists(d.folder / "x"));
}

TEST(CliCamera, a_drawing_that_is_done_is_done_and_another_wants_yes)
{
    const RigDrive d;
    const std::string rig = d.options + "-W 32 ";
    ASSERT_EQ(render(d.folder / "out", rig + "--npy --top").code, 0);
    const std::string run = contents(d.folder / "out/run.json"),
                      picture = contents(d.folder / "out/front/color/000000.png");
    const ProgramResult again = render(d.folder / "out", rig + "--npy --top --json");
    EXPECT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(json_of(again.out), json_of(run)["results"]);
    EXPECT_EQ(contents(d.folder / "out/run.json"), run);
    expect_error(render(d.folder / "out", d.options + "-W 33 --npy --top"), 2, "-y replaces it");
    expect_error(render(d.folder / "out", rig + "--npy --top --background 9,9,9"), 2, "-y replaces it");
    EXPECT_EQ(contents(d.folder / "out/front/color/000000.png"), picture);
    // what only the other drawing had goes, what is not of a drawing stays
    d.folder.put("out/front/color/mine.png", "x");
    ASSERT_EQ(render(d.folder / "out", "--path " + (d.folder / "two.tum").string() + " -W 32 -H 20 -y").code, 0);
    EXPECT_FALSE(fs::exists(d.folder / "out/front/alpha"));
    EXPECT_FALSE(fs::exists(d.folder / "out/tele"));
    EXPECT_FALSE(fs::exists(d.folder / "out/top.png"));
    EXPECT_FALSE(fs::exists(d.folder / "out/front/color/000000.png"));
    EXPECT_EQ(contents(d.folder / "out/front/color/mine.png"), "x");
    // pictures of nobody's run
    for (const char* theirs : {"tele/color", "front/alpha", "top.png", "transforms.json"}) {
        fs::remove_all(d.folder / "theirs");
        fs::create_directories(d.folder / "theirs" / theirs);
        expect_error(render(d.folder / "theirs", rig), 2, "exists; -y replaces it");
    }
}

// of a run, by name, without its state
std::map<std::string, std::string> bytes(const Path& folder)
{
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file() && entry.path().filename() != "journal.jsonl" &&
            entry.path().filename() != "run.json" && entry.path().filename() != "lock")
            files[entry.path().lexically_relative(folder)] = contents(entry.path());
    return files;
}

TEST(CliCamera, files_and_their_order_do_not_depend_on_how_many_threads_make_them)
{
    const RigDrive d;
    std::map<std::string, std::string> whole;
    std::string journal;
    for (const char* threads : {"1", "2", "8"}) {
        const Path out = d.folder / threads;
        const ProgramResult result = render(out, d.options + "--npy --top --json --threads " + threads);
        ASSERT_EQ(result.code, 0) << result.err;
        const Json figures = json_of(result.out);
        EXPECT_GT(figures["seconds"], figures["file_wait_seconds"]);
        EXPECT_GE(figures["file_wait_seconds"], 0);
        if (whole.empty()) {
            whole = bytes(out);
            journal = contents(out / "journal.jsonl");
        }
        EXPECT_TRUE(bytes(out) == whole) << threads;
        EXPECT_EQ(contents(out / "journal.jsonl"), journal) << threads;
    }
    EXPECT_EQ(whole.size(), 6u * 8 + 5);
    EXPECT_EQ(std::ranges::count(journal, '\n'), 7); // a line a frame, and one for top.png
}

TEST(CliCamera, files_of_a_moment_are_measured_and_nothing_stays)
{
    const ScratchFolder folder;
    ::setenv("TMPDIR", folder.path().c_str(), 1);
    const ProgramResult result =
        semrover_program("bench pictures --cameras 2 -W 40 -H 30 --threads 3 --format jpeg --json");
    ::unsetenv("TMPDIR");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_EQ(report["cameras"], 2);
    EXPECT_EQ(report["threads"], 3);
    EXPECT_EQ(report["format"], "jpg");
    EXPECT_GT(report["ms_median"], 0);
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(CliCamera, colours_can_be_jpegs_and_pngs_smaller)
{
    const RigDrive d;
    ASSERT_EQ(render(d.folder / "png", d.options).code, 0);
    ASSERT_EQ(render(d.folder / "jpeg", d.options + "--format jpeg --quality 95").code, 0);
    ASSERT_EQ(render(d.folder / "stored", d.options + "--png-level 0").code, 0);
    const auto color = read_image_rgb8(d.folder / "png/front/color/000001.png"),
               lossy = read_image_rgb8(d.folder / "jpeg/front/color/000001.jpg");
    ASSERT_TRUE(color && lossy);
    double difference = 0;
    for (size_t i = 0; i < color->pixels.size(); ++i)
        difference += std::abs(int(color->pixels[i]) - int(lossy->pixels[i]));
    EXPECT_LT(difference / double(color->pixels.size()), 8);
    EXPECT_GT(difference, 0);
    EXPECT_FALSE(fs::exists(d.folder / "jpeg/front/color/000001.png"));
    EXPECT_EQ(contents(d.folder / "jpeg/front/label/000001.png"), contents(d.folder / "png/front/label/000001.png"));
    EXPECT_EQ(json_of(contents(d.folder / "jpeg/transforms.json"))["frames"][0]["file_path"], "front/color/000000.jpg");
    EXPECT_EQ(read_image_rgb8(d.folder / "stored/front/color/000001.png")->pixels, color->pixels);
    EXPECT_GT(fs::file_size(d.folder / "stored/front/color/000001.png"), 64u * 40 * 3);
    // one that is done is done, another wants -y and takes the JPEGs away
    EXPECT_EQ(render(d.folder / "jpeg", d.options + "--format jpeg --quality 95").code, 0);
    expect_error(render(d.folder / "jpeg", d.options + "--format jpeg --quality 94"), 2, "-y replaces it");
    ASSERT_EQ(render(d.folder / "jpeg", d.options + "-y").code, 0);
    EXPECT_TRUE(bytes(d.folder / "jpeg") == bytes(d.folder / "png"));
}

TEST(CliCamera, a_drawing_that_was_killed_goes_on_to_the_same_bytes)
{
    const RigDrive d;
    std::string poses;
    for (int i = 0; i < 12; ++i)
        poses += fmt::format("{} {} 0 1.7 -0.5 0.5 -0.5 0.5\n", i, 0.5 * i);
    d.folder.put("two.tum", poses);
    const std::string line = d.options + "--npy --video ";
    ASSERT_EQ(render(d.folder / "whole", line + (d.folder / "whole.mp4").string()).code, 0);
    const auto whole = bytes(d.folder / "whole");
    EXPECT_EQ(whole.size(), 12u * 3 * 8 + 4);
    for (const size_t pieces : {0, 1, 8, 30}) {
        const Path out = d.folder / fmt::format("killed{}", pieces), video = out.string() + ".mp4";
        {
            ChildProgram child("render " + kGrid + " -q --splat-radius auto -o " + out.string() + " " + line +
                               video.string());
            while (size_t(std::ranges::count(contents(out / "journal.jsonl"), '\n')) < pieces && child.running())
                usleep(500);
            EXPECT_EQ(child.stop(SIGKILL), 128 + SIGKILL) << pieces;
        }
        if (pieces == 8) { // damaged meanwhile
            fs::resize_file(out / "front/color/000000.png", 20);
            fs::remove(out / "lens/alpha/000001.npy");
        }
        if (pieces == 8) { // a line that names a file elsewhere, which would be waited for if it were opened
            fs::create_directories(d.folder / "trap/color");
            ASSERT_EQ(mkfifo((d.folder / "trap/color/000000.png").c_str(), 0600), 0);
            std::ofstream(out / "journal.jsonl", std::ios::app) << R"({"piece": "../trap/000000", "xxh64": "0"})"
                                                                << "\n";
        }
        if (pieces == 30)
            expect_error(render(out, line + video.string() + " --semantic"), 3, "holds a run with other settings");
        const ProgramResult resumed = render(out, line + video.string());
        EXPECT_EQ(resumed.code, 0) << resumed.err;
        EXPECT_TRUE(whole == bytes(out)) << pieces;
        EXPECT_EQ(contents(d.folder / "whole.mp4"), contents(video)) << pieces;
    }
    // of JPEGs the video is of the colours as they were drawn, too
    const Path out = d.folder / "jpeg", video = d.folder / "jpeg.mp4";
    const std::string jpeg = line + video.string() + " --format jpeg";
    {
        ChildProgram child("render " + kGrid + " -q --splat-radius auto -o " + out.string() + " " + jpeg);
        while (std::ranges::count(contents(out / "journal.jsonl"), '\n') < 8 && child.running())
            usleep(500);
        EXPECT_EQ(child.stop(SIGKILL), 128 + SIGKILL);
    }
    const ProgramResult resumed = render(out, jpeg);
    EXPECT_EQ(resumed.code, 0) << resumed.err;
    EXPECT_EQ(contents(d.folder / "whole.mp4"), contents(video));
}

TEST(CliCamera, beyond_the_limit_of_a_file_s_size_is_an_error_and_leaves_nothing_unfinished)
{
    const RigDrive d;
    const ProgramResult limited = run_program_line(
        "ulimit -f 8; MESA_SHADER_CACHE_DISABLE=1 XDG_CACHE_HOME=" + (d.folder / "none").string() + " " SEMROVER_BINARY,
        "render " + kGrid + " -q -o " + (d.folder / "limited").string() + " " + d.options + "--npy");
    EXPECT_EQ(limited.code, 3) << limited.err;
    EXPECT_NE(limited.err.find("File too large"), std::string::npos) << limited.err;
    for (const auto& entry : fs::recursive_directory_iterator(d.folder / "limited"))
        EXPECT_FALSE(entry.path().filename().string().starts_with(".semrover-")) << entry.path();
}

TEST(CliCamera, a_video_is_a_file_whatever_its_name_looks_like)
{
    const RigDrive d;
    const auto draw = [&](const std::string& video) {
        return run_program_line("cd " + d.folder.path().string() + " && " SEMROVER_BINARY,
                                "render " + kGrid + " -q -o out -y " + d.options + "--video " + video);
    };
    for (const char* name : {"./-dash/v.mp4", "c:on/v.mp4", "tcp:/127.0.0.1:9/v.mp4", "v.mp4"}) {
        const Path video = d.folder / name;
        fs::create_directories(video.parent_path());
        const ProgramResult made = draw(name);
        EXPECT_EQ(made.code, 0) << made.err;
        EXPECT_EQ(contents(video).substr(4, 4), "ftyp") << name;
    }
    // what cannot be renamed is not left there
    fs::create_directories(d.folder / "full/v.mp4/in");
    EXPECT_NE(draw("full/v.mp4").code, 0);
    EXPECT_EQ(std::distance(fs::directory_iterator(d.folder / "full"), fs::directory_iterator()), 1);
}

// a wall whose nearest face is 58.2 m ahead at the left and 88.2 m at the right, and nothing else
TEST(CliCamera, depth_that_16_bits_do_not_hold_is_nothing_and_what_is_above_is_sky)
{
    const ScratchFolder folder;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int j = -100; j < 100; ++j)
        for (int k = -100; k < 20; ++k) {
            grid.cells.push_back({j < 0 ? 147 : 97, j, k});
            grid.labels.push_back(2);
        }
    sort_cells(grid);
    ASSERT_TRUE(write_grid(folder / "wall.sgrid", grid));
    const Path one = folder.put("one.tum", "0 0 0 0 -0.5 0.5 -0.5 0.5\n");
    const auto draw = [&](const Path& out, const std::string& more) {
        return semrover_program("render " + (folder / "wall.sgrid").string() +
                                " -q --semantic -W 60 -H 40 --fov-x 60 -o " + out.string() + " --path " + one.string() +
                                " " + more);
    };
    const ProgramResult result = draw(folder / "out", "--npy");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto depth = read_png_gray16(folder / "out/depth/000000.png");
    const auto label = read_png_rgb8(folder / "out/label/000000.png");
    const auto metres = plane(folder / "out/depth_expected/000000.npy", {60, 40});
    const auto at = [](size_t x, size_t y) { return y * 60 + x; };
    EXPECT_NEAR(depth->pixels[at(10, 25)], 58200, 60); // y is left: j of 0 and more
    EXPECT_NEAR(metres[at(50, 25)], 88.2, 0.06);
    EXPECT_EQ(depth->pixels[at(50, 25)], 0);
    EXPECT_EQ(label->pixels[3 * at(50, 25)], 2);
    EXPECT_EQ(label->pixels[3 * at(30, 0)], 10);
    for (const uint16_t d : depth->pixels)
        EXPECT_NE(d, 65535);
    // other units hold it
    for (const auto& [name, units] : {std::pair{"cm", 100.}, {"kitti256", 256.}}) {
        const Path other = folder / name;
        ASSERT_EQ(draw(other, std::string("--depth ") + name).code, 0);
        const auto d = read_png_gray16(other / "depth/000000.png");
        for (size_t i = 0; i < metres.size(); ++i)
            ASSERT_NEAR(d->pixels[i] / units, metres[i], 0.5001 / units) << name << " " << i;
        EXPECT_GT(d->pixels[at(50, 25)], 88 * units);
        EXPECT_EQ(json_of(contents(other / "transforms.json"))["depth_unit_scale_factor"], 1 / units);
        EXPECT_EQ(contents(other / "label/000000.png"), contents(folder / "out/label/000000.png"));
        EXPECT_EQ(draw(other, std::string("--depth ") + name).code, 0); // done, and others are other settings
        expect_error(draw(other, ""), 2, "-y replaces it");
    }
    ASSERT_EQ(draw(folder / "npy", "--npy --depth npy").code, 0);
    EXPECT_EQ(contents(folder / "npy/depth/000000.npy"), contents(folder / "npy/depth_expected/000000.npy"));
    EXPECT_EQ(json_of(contents(folder / "npy/transforms.json"))["depth_unit_scale_factor"], 1.0);
    EXPECT_FALSE(fs::exists(folder / "npy/depth/000000.png"));
    // the same without the lower half: what is below is not sky
    VoxelGrid above = grid;
    above.cells.clear();
    above.labels.clear();
    for (size_t c = 0; c < grid.cells.size(); ++c)
        if (grid.cells[c][2] >= 0)
            append_cell(above, grid, c);
    ASSERT_TRUE(write_grid(folder / "above.sgrid", above));
    ASSERT_EQ(semrover_program("render " + (folder / "above.sgrid").string() + " -q --semantic -W 60 -H 40 -o " +
                               (folder / "b").string() + " --path " + one.string())
                  .code,
              0);
    const auto below = read_png_rgb8(folder / "b/label/000000.png");
    EXPECT_EQ(below->pixels[3 * at(30, 0)], 10);
    EXPECT_EQ(below->pixels[3 * at(30, 39)], 255);
}

TEST(CliCamera, colmap_takes_points_and_pictures_along)
{
    const RigDrive d;
    ASSERT_EQ(render(d.folder / "out", d.options).code, 0);
    const std::string frames = (d.folder / "out/transforms.json").string();
    const ProgramResult result =
        convert(frames, d.folder / "data/sparse/0", "--points " + kGrid + " --images " + (d.folder / "out").string());
    ASSERT_EQ(result.code, 0) << result.err;
    std::set<std::string> last;
    std::istringstream images(contents(d.folder / "data/sparse/0/images.txt"));
    for (std::string line; std::getline(images, line);)
        if (line.ends_with(".png")) {
            const Path name = line.substr(line.rfind(' ') + 1);
            EXPECT_TRUE(last.insert(name.filename()).second) << name; // 3DGS' first loader takes no more of it
            EXPECT_TRUE(fs::exists(d.folder / "data/images" / name)) << name;
            EXPECT_TRUE(fs::exists(d.folder / "data/images" / name.filename())) << name;
        }
    EXPECT_EQ(last.size(), 6u);
    EXPECT_EQ(contents(d.folder / "data/images/tele/tele_000001.png"),
              contents(d.folder / "out/tele/color/000001.png"));
    const auto grid = read_grid(kGrid);
    std::istringstream points(contents(d.folder / "data/sparse/0/points3D.txt"));
    size_t count = 0;
    for (std::string line; std::getline(points, line);) {
        if (line.starts_with("#"))
            continue;
        std::istringstream words(line);
        double id, x, y, z, r, g, b, error;
        ASSERT_TRUE(words >> id >> x >> y >> z >> r >> g >> b >> error) << line;
        EXPECT_TRUE(r >= 0 && r <= 255 && z > -10 && z < 40) << line;
        ++count;
    }
    EXPECT_EQ(count, grid->cells.size() * size_t(grid->points_per_voxel));
    const auto back = read_colmap(d.folder / "data/sparse/0");
    EXPECT_EQ(back->frames[1].camera, "lens"); // by name, moment by moment
    ASSERT_EQ(convert(frames, d.folder / "t.json", "--points " + kGrid).code, 0);
    EXPECT_EQ(json_of(contents(d.folder / "t.json"))["ply_file_path"], "points.ply");
    EXPECT_TRUE(fs::exists(d.folder / "points.ply"));
    expect_error(convert(frames, d.folder / "u.json", "--points " + kGrid), 2, "points.ply' exists; -y replaces it");
    expect_error(convert(frames, d.folder / "a.tum", "--camera tele --points " + kGrid), 2, "has no place for them");
    expect_error(convert(frames, d.folder / "c", "--images " + d.folder.path().string()), 3, "is missing, and so is");
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
