// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "engine/scene/grid.h"
#include "runtime/base/json.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/street_scene.h"
#include "tools/trajectory/camera_path.h"

#include <cmath>
#include <fstream>
#include <gtest/gtest.h>
#include <map>

namespace semrover {
namespace cli_fuse_test {

namespace fs = std::filesystem;

// pictures as `render` writes them, of a drive along x
class Drive {
  public:
    explicit Drive(size_t frames = 3, bool two_cameras = false)
    {
        path.frames = StreetScene::drive(frames, 96, 72);
        if (two_cameras) {
            CameraPath both;
            for (const CameraFrame& f : path.frames)
                for (const char* name : {"front", "left"}) {
                    both.frames.push_back(f);
                    both.frames.back().camera = name;
                    if (both.frames.back().camera == "left")
                        both.frames.back().intrinsics = pinhole_from_fov(90, 80, 60);
                }
            path = both;
        }
        std::map<std::string, uint32_t> counts;
        for (const CameraFrame& f : path.frames) {
            const Path base = f.camera.empty() ? folder / "in" : folder / "in" / f.camera;
            for (const char* kind : {"depth", "label", "color"})
                fs::create_directories(base / kind);
            put_pictures(base, fmt::format("{:06}", counts[f.camera]++), f);
        }
        EXPECT_TRUE(write_transforms(folder / "in/transforms.json", path));
    }

    ProgramResult fuse(const std::string& more = "") const
    {
        return semrover_program("fuse " + (folder / "in").string() + " -o " + out().string() + " -q --max-depth 10 " +
                                more);
    }
    Path out() const { return folder / "out"; }
    Path in(std::string_view name) const { return folder / "in" / name; }

    // exit code 3, one line with the text, nothing written
    void expect_refusal(std::string_view text, const std::string& more = "", int code = 3) const
    {
        std::string options = more; // @ stands for the folder
        if (const size_t at = options.find('@'); at != std::string::npos)
            options.replace(at, 1, folder.path().string());
        const ProgramResult result = fuse(options);
        EXPECT_EQ(result.code, code) << result.err;
        EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
        EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
        EXPECT_FALSE(fs::exists(out()));
    }
    void replace_in(std::string_view name, const std::string& from, const std::string& to) const
    {
        std::string text = contents(in(name));
        ASSERT_NE(text.find(from), std::string::npos) << text.substr(0, 400);
        text.replace(text.find(from), from.size(), to);
        folder.put("in/" + std::string(name), text);
    }

    static std::vector<uint16_t> millimetres(const std::vector<float>& metres)
    {
        std::vector<uint16_t> out;
        for (const float d : metres)
            out.push_back(uint16_t(std::lround(d * 1000)));
        return out;
    }

    ScratchFolder folder;
    StreetScene street;
    CameraPath path;

  private:
    void put_pictures(const Path& base, const std::string& name, const CameraFrame& f) const
    {
        const DepthImages images = street.render(f);
        const uint32_t w = f.intrinsics.width, h = f.intrinsics.height;
        EXPECT_TRUE(write_png_gray16(base / "depth" / (name + ".png"), w, h, millimetres(images.depth)));
        EXPECT_TRUE(write_png_gray8(base / "label" / (name + ".png"), w, h, images.labels));
        EXPECT_TRUE(write_png_rgb8(base / "color" / (name + ".png"), w, h, images.colors));
    }
};

Json run_of(const Path& folder)
{
    const auto run = read_json(folder / "run.json");
    EXPECT_TRUE(run) << run.error().message;
    return run ? *run : Json();
}

TEST(CliFuse, depth_is_in_the_unit_that_transforms_json_says)
{
    const Drive drive;
    TransformsFiles files;
    files.pictures = [](const std::string& camera, uint32_t number) { return rendered_pictures(camera, number); };
    const auto change = [&](const auto& depth_of) {
        for (uint32_t i = 0; i < drive.path.frames.size(); ++i) {
            const Path picture = drive.in(fmt::format("depth/{:06}.png", i));
            auto depth = read_png_gray16(picture);
            ASSERT_TRUE(depth) << depth.error().message;
            for (uint16_t& d : depth->pixels)
                d = depth_of(d);
            ASSERT_TRUE(write_png_gray16(picture, depth->width, depth->height, depth->pixels));
        }
    };
    change([](uint16_t d) { return uint16_t(d < 32000 ? d : 0); });
    ASSERT_EQ(drive.fuse().code, 0);
    const std::string mesh = contents(drive.out() / "mesh.glb");
    change([](uint16_t d) { return uint16_t(2 * d); });
    files.depth_unit = 0.0005;
    ASSERT_TRUE(write_transforms(drive.in("transforms.json"), drive.path, files));
    ASSERT_EQ(drive.fuse("-y").code, 0);
    EXPECT_TRUE(contents(drive.out() / "mesh.glb") == mesh);
    ASSERT_EQ(drive.fuse("-y --depth-scale 0.001").code, 0); // an option overrides it
    EXPECT_FALSE(contents(drive.out() / "mesh.glb") == mesh);
}

TEST(CliFuse, a_drive_becomes_a_mesh_and_two_grids_of_the_same_cells)
{
    const Drive drive;
    const ProgramResult result = drive.fuse("--json");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json figures = json_of(result.out), run = run_of(drive.out());
    EXPECT_EQ(run["results"], figures);
    EXPECT_EQ(run["settings"]["excluded"], Json::array({"sky"}));
    EXPECT_EQ(figures["frames"], 3);
    EXPECT_GT(figures["faces"], 3000);
    EXPECT_EQ(contents(drive.out() / "mesh.glb").substr(0, 4), "glTF");
    const auto semantic = read_grid(drive.out() / "semantic.sgrid"),
               voxfield = read_grid(drive.out() / "voxfield.sgrid");
    ASSERT_TRUE(semantic) << semantic.error().message;
    ASSERT_TRUE(voxfield) << voxfield.error().message;
    EXPECT_EQ(semantic->cells, voxfield->cells);
    EXPECT_EQ(semantic->labels, voxfield->labels);
    EXPECT_FALSE(semantic->has_points());
    EXPECT_EQ(voxfield->points_per_voxel, 20);
    EXPECT_EQ(voxfield->voxel_size, 0.6f);
    for (const uint8_t label : {0, 1, 2, 13})
        EXPECT_GT(std::ranges::count(semantic->labels, label), 5) << int(label);
    // again: refused, then the same bytes
    EXPECT_EQ(drive.fuse().code, 2);
    std::map<std::string, std::string> before;
    for (const char* name : {"mesh.glb", "semantic.sgrid", "voxfield.sgrid"})
        before[name] = contents(drive.out() / name);
    ASSERT_EQ(drive.fuse("-y").code, 0);
    for (const auto& [name, bytes] : before)
        EXPECT_TRUE(contents(drive.out() / name) == bytes) << name;
}

TEST(CliFuse, cameras_of_a_rig_lie_in_folders_of_their_names)
{
    const Drive drive(2, true);
    const ProgramResult result = drive.fuse("--mesh-format ply --exclude car,8");
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(run_of(drive.out())["results"]["frames"], 4);
    EXPECT_EQ(contents(drive.out() / "mesh.ply").substr(0, 4), "ply\n");
    const auto grid = read_grid(drive.out() / "semantic.sgrid");
    ASSERT_TRUE(grid) << grid.error().message;
    EXPECT_EQ(std::ranges::count(grid->labels, 13) + std::ranges::count(grid->labels, 8), 0);
}

TEST(CliFuse, poses_and_intrinsics_may_come_from_elsewhere)
{
    const Drive drive;
    ASSERT_EQ(drive.fuse().code, 0);
    const std::string expect = contents(drive.out() / "semantic.sgrid");
    ASSERT_TRUE(write_tum(drive.folder / "poses.tum", drive.path));
    fs::remove(drive.in("transforms.json"));
    const std::string poses = " -y --poses " + (drive.folder / "poses.tum").string();
    const auto& k = drive.path.frames[0].intrinsics;
    for (const std::string& more :
         {std::string("--fov-x 80"), fmt::format("--fx {} --cx 48 --cy 36", k.fx), std::string()}) {
        if (more.empty())
            drive.folder.put(
                "in/intrinsics.json",
                Json{{"fx", k.fx}, {"fy", k.fy}, {"cx", 48}, {"cy", 36}, {"width", 96}, {"height", 72}}.dump());
        const ProgramResult result = drive.fuse(more + poses);
        ASSERT_EQ(result.code, 0) << result.err;
        const auto a = read_grid(drive.out() / "semantic.sgrid");
        ASSERT_TRUE(a);
        EXPECT_NEAR(double(contents(drive.out() / "semantic.sgrid").size()), double(expect.size()),
                    0.02 * double(expect.size()))
            << more;
    }
}

TEST(CliFuse, pictures_may_have_names_of_their_own)
{
    const Drive drive;
    fs::create_directories(drive.in("shots"));
    for (const char* n : {"0", "1", "2"}) {
        const std::string from = std::string("00000") + n, to = std::string("shot_") + n;
        const auto color = read_png_rgb8(drive.in("color/" + from + ".png"));
        ASSERT_TRUE(color);
        ASSERT_TRUE(write_jpeg_rgb8(drive.in("shots/" + to + ".jpg"), color->width, color->height, color->pixels, 95));
        for (const char* kind : {"depth/", "label/"})
            fs::rename(drive.in(kind + from + ".png"), drive.in(kind + to + ".png"));
        drive.replace_in("transforms.json", "color/" + from + ".png", "./shots/" + to); // without its extension
    }
    fs::rename(drive.in("depth/shot_1.png"), drive.in("elsewhere.png"));
    drive.replace_in("transforms.json", "\"file_path\": \"./shots/shot_1\"",
                     "\"depth_file_path\": \"elsewhere.png\", \"file_path\": \"./shots/shot_1\"");
    const ProgramResult result = drive.fuse();
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(run_of(drive.out())["results"]["colored_frames"], 3);
    EXPECT_EQ(run_of(drive.out())["results"]["labelled_frames"], 3);
}

TEST(CliFuse, what_has_no_label_is_left_out_of_the_grids_or_given_one)
{
    const Drive drive;
    fs::remove_all(drive.in("label"));
    drive.expect_refusal("no face has a label, so there are no grids to make");
    const ProgramResult result = drive.fuse("--default-label building");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto grid = read_grid(drive.out() / "semantic.sgrid");
    ASSERT_TRUE(grid);
    EXPECT_EQ(size_t(std::ranges::count(grid->labels, 2)), grid->cells.size());
    EXPECT_EQ(run_of(drive.out())["results"]["unlabelled_faces"], run_of(drive.out())["results"]["faces"]);
}

TEST(CliFuse, unknown_labels_are_listed_with_counts_and_may_be_mapped)
{
    const Drive drive;
    std::vector<uint8_t> labels(96 * 72, 0);
    std::fill_n(labels.begin(), 5, 77);
    std::fill_n(labels.begin() + 5, 3, 200);
    ASSERT_TRUE(write_png_gray8(drive.in("label/000001.png"), 96, 72, labels));
    drive.expect_refusal("unknown labels: 77 (5 pixels), 200 (3 pixels); --map says what they are; found "
                         "are 0 road (");
    const Path map = drive.folder.put("map.json", R"({"77": "car", "200": null, "pole": 3})");
    EXPECT_EQ(drive.fuse("--map " + map.string()).code, 0);
    const auto grid = read_grid(drive.out() / "semantic.sgrid");
    ASSERT_TRUE(grid);
    EXPECT_EQ(std::ranges::count(grid->labels, 5), 0);
}

TEST(CliFuse, bad_options_are_usage_errors)
{
    const Drive drive(1);
    drive.expect_refusal("--exclude: unknown class 'tree'", "--exclude tree", 2);
    drive.expect_refusal("--default-label: unknown class '20'", "--default-label 20", 2);
    drive.expect_refusal("--min-views", "--min-views 9", 2);
}

void break_png(const Path& path)
{
    const std::string text = contents(path);
    std::ofstream(path, std::ios::binary).write(text.data(), std::streamsize(text.size() / 2));
}

TEST(CliFuse, bad_input_is_one_line_and_leaves_nothing_behind)
{
    struct Case {
        const char* says;
        std::function<void(const Drive&)> spoil;
        std::string more = "";
    };
    const std::vector<uint16_t> small(50 * 40, 1000);
    const std::vector<uint8_t> gray(50 * 40, 1), rgb(96 * 72 * 3, 7);
    const Case cases[] = {
        {"transforms.json' is missing", [](const Drive& d) { fs::remove(d.in("transforms.json")); }},
        {"expected a folder of depth/", [](const Drive& d) { fs::remove_all(d.in("")); }},
        {"000001.png' is missing", [](const Drive& d) { fs::remove(d.in("depth/000001.png")); }},
        {"label/000002.png' is missing", [](const Drive& d) { fs::remove(d.in("label/000002.png")); }},
        {"color/000000.png' is missing", [](const Drive& d) { fs::remove(d.in("color/000000.png")); }},
        {"is 50 x 40 pixels, the camera has 96 x 72",
         [&](const Drive& d) { EXPECT_TRUE(write_png_gray16(d.in("depth/000002.png"), 50, 40, small)); }},
        {"label/000000.png' is 50 x 40 pixels",
         [&](const Drive& d) { EXPECT_TRUE(write_png_gray8(d.in("label/000000.png"), 50, 40, gray)); }},
        {"expected a PNG of 16-bit gray",
         [&](const Drive& d) { EXPECT_TRUE(write_png_rgb8(d.in("depth/000000.png"), 96, 72, rgb)); }},
        {"label/000001.png': a picture in colour, expected class numbers: a PNG of gray values or palette indices",
         [&](const Drive& d) {
             std::vector<uint8_t> colors = rgb;
             for (uint8_t i = 0; i < 3; ++i)
                 colors[i] = uint8_t(i + 1);
             EXPECT_TRUE(write_png_rgb8(d.in("label/000001.png"), 96, 72, colors));
         }},
        {"not a valid PNG", [](const Drive& d) { break_png(d.in("depth/000001.png")); }},
        {"expected a path inside the folder, found '../x.png'",
         [](const Drive& d) { d.replace_in("transforms.json", "color/000001.png", "../x.png"); }},
        {"expected a path inside the folder, found '/etc/passwd'",
         [](const Drive& d) { d.replace_in("transforms.json", "color/000001.png", "/etc/passwd"); }},
        {"transform_matrix", [](const Drive& d) { d.replace_in("transforms.json", "transform_matrix", "matrix"); }},
        {"; --max-depth goes further (by default, to where a pixel is 0.55 voxels wide, so a larger --tsdf-voxel",
         [](const Drive& d) {
             const std::vector<uint16_t> none(96 * 72);
             for (const char* n : {"0", "1", "2"})
                 EXPECT_TRUE(write_png_gray16(d.in(std::string("depth/00000") + n + ".png"), 96, 72, none));
         }},
        {"m from frame 0 along x, expected a scene of at most 10000 m",
         [](const Drive& d) {
             CameraPath far = d.path;
             far.frames[2] = StreetScene::camera({1e5, 0, 2}, 0, 0, far.frames[2].intrinsics);
             EXPECT_TRUE(write_transforms(d.in("transforms.json"), far));
         }},
        {"has no intrinsics: expected", [](const Drive& d) { EXPECT_TRUE(write_tum(d.folder / "p.tum", d.path)); },
         "--poses @/p.tum"},
        {"p.tum' has 1 poses", [](const Drive& d) { d.folder.put("p.tum", "0 0 0 1.6 -0.5 0.5 -0.5 0.5\n"); },
         "--fov-x 80 --poses @/p.tum"},
        {"quaternion", [](const Drive& d) { d.folder.put("p.tum", "0 0 0 1.6 0 0 0 0.5\n"); },
         "--fov-x 80 --poses @/p.tum"},
        {"fx is missing", [](const Drive& d) { d.folder.put("in/intrinsics.json", R"({"fy": 3})"); },
         "--poses @/p.tum"},
        {"the source has no label of that name", [](const Drive& d) { d.folder.put("map.json", R"({"tree": 8})"); },
         "--map @/map.json"},
    };
    for (const Case& c : cases) {
        SCOPED_TRACE(c.says);
        const Drive drive;
        c.spoil(drive);
        drive.expect_refusal(c.says, c.more);
    }
}

TEST(CliFuse, device_memory_that_does_not_suffice_is_refused_and_little_of_it_gives_the_same)
{
    const Drive drive;
    ASSERT_EQ(drive.fuse().code, 0);
    const std::string expect = contents(drive.out() / "mesh.glb");
    const uint64_t peak = run_of(drive.out())["results"]["peak_device_bytes"];
    const ProgramResult little = drive.fuse(fmt::format("-y --max-vram {}", peak * 6 / 10));
    ASSERT_EQ(little.code, 0) << little.err;
    EXPECT_GT(run_of(drive.out())["results"]["chunks"], 1);
    EXPECT_LE(run_of(drive.out())["results"]["peak_device_bytes"], peak * 6 / 10);
    EXPECT_TRUE(contents(drive.out() / "mesh.glb") == expect);
    fs::remove_all(drive.out());
    drive.expect_refusal("--max-vram", "--max-vram 1MB", 5);
}

} // namespace cli_fuse_test
} // namespace semrover
