// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "engine/scene/grid.h"
#include "runtime/base/json.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/json_text.h"
#include "tests/support/png_file.h"
#include "tests/support/program.h"
#include "tests/support/street_scene.h"
#include "tools/trajectory/camera_path.h"

#include <cmath>
#include <fstream>
#include <gtest/gtest.h>
#include <map>
#include <regex>

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

// a flat wall 6 m ahead, seen by three cameras at (0, 0, 1.5) that look along x
class Wall {
  public:
    static constexpr uint32_t kWidth = 80, kHeight = 60, kFocal = 60;
    using Rows = std::function<std::string(uint32_t x, uint32_t y)>; // a pixel as a PNG has it

    ScratchFolder folder;

    Path in(std::string_view name) const { return folder / "in" / name; }
    void put(const std::string& name, const std::string& bytes) const
    {
        fs::create_directories(in(name).parent_path());
        folder.put("in/" + name, bytes);
    }
    void put_png(const std::string& name, int bits, int kind, const Rows& pixel, uint32_t times = 1,
                 const std::string& palette = "") const
    {
        PngFile file{kWidth * times, kHeight * times, bits, kind, {}, palette};
        for (uint32_t y = 0; y < file.height; ++y)
            for (uint32_t x = 0; x < file.width; ++x)
                file.rows += pixel(x / times, y / times);
        put(name, file.bytes());
    }
    static std::string name(size_t i, const char* kind, const char* ending = "png")
    {
        return fmt::format("{}/{:06}.{}", kind, i, ending);
    }
    void put_depth(const std::string& name) const
    {
        put_png(name, 16, PngFile::kGray, [](uint32_t, uint32_t) { return std::string("\x17\x70"); });
    }
    void put_all_depth() const
    {
        for (size_t i = 0; i < 3; ++i)
            put_depth(name(i, "depth"));
    }
    // `times`: of pictures so many times as wide as depth
    void put_poses(double times = 1) const
    {
        Json frames = Json::array();
        for (size_t i = 0; i < 3; ++i)
            frames.push_back({{"file_path", name(i, "color")},
                              {"transform_matrix", {{0, 0, -1, 0}, {-1, 0, 0, 0}, {0, 1, 0, 1.5}, {0, 0, 0, 1}}}});
        put("transforms.json", Json{{"w", kWidth * times},
                                    {"h", kHeight * times},
                                    {"fl_x", kFocal * times},
                                    {"cx", kWidth / 2 * times},
                                    {"cy", kHeight / 2 * times},
                                    {"frames", frames}}
                                   .dump());
    }
    ProgramResult fuse(const std::string& more = "--default-label building") const
    {
        return semrover_program("fuse " + in("").string() + " -y -o " + (folder / "out").string() +
                                " --max-depth 12 --tsdf-voxel 0.2 " + more);
    }
    VoxelGrid grid(const ProgramResult& result) const
    {
        EXPECT_EQ(result.code, 0) << result.err;
        auto read = read_grid(folder / "out/voxfield.sgrid");
        EXPECT_TRUE(read) << read.error().message;
        return read ? std::move(*read) : VoxelGrid();
    }
    // the points lie where the wall is, 6 m ahead and as wide as it is seen
    void expect_wall(const ProgramResult& result) const
    {
        const VoxelGrid g = grid(result);
        std::array<double, 3> low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
        for (size_t i = 0; i < g.points.size() / 3; ++i)
            for (size_t a = 0; a < 3; ++a) {
                const double x = (g.cells[i / 20][a] + 0.5) * 0.6 + double(half_to_float(g.points[3 * i + a]));
                low[a] = std::min(low[a], x);
                high[a] = std::max(high[a], x);
            }
        EXPECT_NEAR(low[0], 6, 0.01);
        EXPECT_NEAR(high[0], 6, 0.01);
        EXPECT_NEAR(low[1], -4, 0.25); // 40 pixels at 60 a radian: 4 m to each side
        EXPECT_NEAR(high[1], 4, 0.25);
        EXPECT_NEAR(low[2], -1.5, 0.25);
        EXPECT_NEAR(high[2], 4.5, 0.25);
    }
    std::map<int, size_t> labels(const ProgramResult& result) const
    {
        std::map<int, size_t> counts;
        for (const uint8_t label : grid(result).labels)
            ++counts[label];
        return counts;
    }
};

std::string two_bytes(uint16_t value)
{
    return {char(value >> 8), char(value & 255)};
}

bool warns(const ProgramResult& result, std::string_view text)
{
    return result.err.find("semrover: warning: ") != std::string::npos && result.err.find(text) != std::string::npos;
}

TEST(CliFuse, depth_may_be_along_the_ray_in_carlas_colours_or_in_arrays)
{
    const Wall w;
    w.put_poses();
    w.put_all_depth();
    w.expect_wall(w.fuse());
    const auto far = [](uint32_t x, uint32_t y) {
        return 6 * std::hypot((x + 0.5 - 40) / 60, (y + 0.5 - 30) / 60, 1); // metres along the ray
    };
    for (size_t i = 0; i < 3; ++i)
        w.put_png(Wall::name(i, "depth"), 16, PngFile::kGray,
                  [&](uint32_t x, uint32_t y) { return two_bytes(uint16_t(std::lround(5000 * far(x, y)))); });
    w.expect_wall(w.fuse("--default-label building --depth-kind ray --depth-scale 0.0002"));
    EXPECT_EQ(run_of(w.folder / "out")["settings"]["depth_kind"], "ray");
    for (size_t i = 0; i < 3; ++i)
        w.put_png(Wall::name(i, "depth"), 8, PngFile::kRgba,
                  [](uint32_t, uint32_t) { return std::string("\x37\x89\x01\xff"); });
    const ProgramResult carla = w.fuse();
    w.expect_wall(carla);
    EXPECT_TRUE(warns(carla, "is in 8-bit colour: read as CARLA's depth")) << carla.err;
    EXPECT_FALSE(warns(w.fuse("--default-label building --depth-kind carla"), "CARLA"));
    for (size_t i = 0; i < 3; ++i) {
        fs::remove(w.in(Wall::name(i, "depth")));
        NpyArray array{DType::f32, {Wall::kHeight, Wall::kWidth}, {}};
        std::vector<float> metres;
        for (uint32_t p = 0; p < Wall::kWidth * Wall::kHeight; ++p)
            metres.push_back(float(far(p % Wall::kWidth, p / Wall::kWidth)));
        array.data.assign(std::as_bytes(std::span(metres)).begin(), std::as_bytes(std::span(metres)).end());
        const std::vector<std::byte> file = encode_npy(array);
        w.put(Wall::name(i, "depth", "npy"), {reinterpret_cast<const char*>(file.data()), file.size()});
    }
    w.expect_wall(w.fuse("--default-label building --depth-kind ray"));
}

TEST(CliFuse, intrinsics_colours_and_labels_of_other_sizes_are_brought_to_depth)
{
    const Wall w;
    w.put_all_depth();
    // three times as wide: the left half blue and a building, the right red and a car
    for (size_t i = 0; i < 3; ++i) {
        w.put_png(
            Wall::name(i, "color"), 8, PngFile::kRgb,
            [](uint32_t x, uint32_t) { return x < 40 ? std::string("\0\0\xff", 3) : std::string("\xff\0\0", 3); }, 3);
        w.put_png(
            Wall::name(i, "label"), 8, PngFile::kGray,
            [](uint32_t x, uint32_t) { return std::string(x < 40 ? "\x02" : "\x0d"); }, 2);
    }
    // intrinsics of depth, then of colour; without a size they are of colour
    for (const auto& [times, sized] : {std::pair{1.0, true}, {3.0, true}, {3.0, false}}) {
        w.put_poses(times);
        Json poses = json_of(contents(w.in("transforms.json")));
        for (const char* side : {"w", "h"})
            if (!sized)
                poses.erase(side);
        w.put("transforms.json", poses.dump());
        const ProgramResult result = w.fuse("");
        w.expect_wall(result);
        EXPECT_EQ(
            warns(result, "frame 0: intrinsics are of 240 x 180 pixels, depth has 80 x 60: they are scaled to depth"),
            times == 3)
            << result.err;
        const VoxelGrid g = w.grid(result);
        for (size_t cell = 0; cell < g.cells.size(); ++cell) {
            const int j = g.cells[cell][1]; // left is +y
            if (j >= -1 && j <= 0)
                continue;
            EXPECT_EQ(g.labels[cell], j > 0 ? 2 : 13);
            EXPECT_EQ(g.colors[cell * 60], j > 0 ? 0 : 255);
            EXPECT_EQ(g.colors[cell * 60 + 2], j > 0 ? 255 : 0);
        }
    }
    w.put_png(Wall::name(1, "color"), 8, PngFile::kRgb, [](uint32_t, uint32_t) { return std::string("\0\0\0", 3); });
    ASSERT_TRUE(write_png_rgb8(w.in(Wall::name(2, "color")), 80, 45, std::vector<uint8_t>(80 * 45 * 3)));
    const ProgramResult wide = w.fuse("");
    EXPECT_EQ(wide.code, 3);
    EXPECT_NE(wide.err.find("is 80 x 45 pixels, the depth of its frame has 80 x 60: expected the same view"),
              std::string::npos)
        << wide.err;
}

TEST(CliFuse, intrinsics_of_colmap_and_kitti_are_used_and_colmaps_names_find_the_pictures)
{
    const Wall w;
    // COLMAP knows pictures 0, 2 and 7 of eight; its size is twice that of depth
    for (size_t i = 0; i < 8; ++i)
        w.put_depth(Wall::name(i, "depth"));
    for (const size_t i : {1, 3, 4, 5, 6})
        w.put_png(Wall::name(i, "depth"), 16, PngFile::kGray, [](uint32_t, uint32_t) { return two_bytes(2000); });
    fs::create_directory(w.folder / "colmap");
    w.folder.put("colmap/cameras.txt", "1 PINHOLE 160 120 120 120 80 60\n");
    std::string images;
    for (const int i : {7, 0, 2})
        images += fmt::format("{} 0.5 0.5 -0.5 0.5 0 1.5 0 1 {:06}.png\n\n", i + 1, i);
    w.folder.put("colmap/images.txt", images);
    const ProgramResult colmap = w.fuse("--default-label building --poses " + (w.folder / "colmap").string());
    w.expect_wall(colmap);
    EXPECT_TRUE(warns(colmap, "intrinsics are of 160 x 120 pixels, depth has 80 x 60")) << colmap.err;
    EXPECT_EQ(run_of(w.folder / "out")["results"]["frames"], 3);
    w.folder.put("colmap/cameras.txt", "1 OPENCV 160 120 120 120 80 60 0.1 0 0 0\n");
    const ProgramResult lens = w.fuse("--poses " + (w.folder / "colmap").string());
    EXPECT_EQ(lens.code, 3);
    EXPECT_NE(lens.err.find("lens with distortion, expected a pinhole"), std::string::npos) << lens.err;

    for (size_t i = 3; i < 8; ++i)
        fs::remove(w.in(Wall::name(i, "depth")));
    w.put_all_depth();
    fs::create_directory(w.folder / "kitti");
    std::string poses;
    for (int i = 0; i < 3; ++i)
        poses += "0 0 1 0 -1 0 0 0 0 -1 0 1.5\n";
    const std::string kitti = "--default-label building --poses " + w.folder.put("kitti/poses.txt", poses).string();
    const std::string projection = "P0: 60 0 39.5 0 0 60 29.5 0 0 0 1 0\n";
    for (const std::string size : {"S_rect_00: 80 60\n", ""}) { // the odometry set's says none: depth's
        w.folder.put("kitti/calib.txt", size + projection);
        w.expect_wall(w.fuse(kitti));
    }
    w.folder.put("kitti/calib.txt", "S_rect_00: 160 120\nP0: 120 0 79.5 0 0 120 59.5 0 0 0 1 0\n");
    w.expect_wall(w.fuse(kitti));
    fs::remove(w.folder / "kitti/calib.txt");
    EXPECT_NE(w.fuse(kitti).err.find("has no intrinsics: expected"), std::string::npos);
}

TEST(CliFuse, poses_in_a_file_each_find_the_pictures_of_their_names)
{
    const Wall w; // ScanNet: numbers without leading zeros, a frame without a pose
    for (const int frame : {2, 9, 10}) {
        w.put_depth(fmt::format("depth/{}.png", frame));
        const bool lost = frame == 9;
        w.put(fmt::format("pose/{}.txt", frame), lost
                                                     ? "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n"
                                                       "-inf -inf -inf -inf\n"
                                                     : "0 0 1 0\n-1 0 0 0\n0 -1 0 1.5\n0 0 0 1\n");
    }
    const std::string line = "--default-label building --fx 60 --poses ";
    const ProgramResult result = w.fuse(line + w.in("pose").string());
    w.expect_wall(result);
    EXPECT_TRUE(warns(result, "1 of 3 files have no pose (inf)")) << result.err;
    EXPECT_EQ(run_of(w.folder / "out")["results"]["frames"], 2);
}

TEST(CliFuse, pictures_named_by_time_meet_the_poses_nearest_in_time)
{
    const Wall w;
    // TUM RGB-D: depth at 10.00, 10.05, 10.10, 10.50 s; colour 4 ms later; poses each 10 ms up to 10.12 s
    const auto far = [](uint32_t, uint32_t) { return two_bytes(30000); }; // 5000 a metre
    for (const char* time : {"1305031110.000000", "1305031110.050000", "1305031110.100000", "1305031110.500000"})
        w.put_png(fmt::format("depth/{}.png", time), 16, PngFile::kGray, far);
    for (const char* time : {"1305031110.004000", "1305031110.054000", "1305031110.104000", "1305031110.504000"})
        w.put_png(fmt::format("rgb/{}.png", time), 8, PngFile::kRgb,
                  [](uint32_t, uint32_t) { return std::string("\xc8\x64\x32"); });
    std::string poses = "# ground truth trajectory\n";
    for (int i = 0; i < 13; ++i) // all but those of the depth pictures look away
        poses += fmt::format("{:.4f} 0 0 1.5 {}\n", 1305031110.001 + 0.01 * i,
                             i % 5 == 0 ? "-0.5 0.5 -0.5 0.5" : "0.5 0.5 0.5 0.5");
    w.put("groundtruth.txt", poses);
    const std::string lens = "--default-label building --fx 60";
    const ProgramResult result = w.fuse(lens + " --depth-scale 0.0002");
    w.expect_wall(result);
    EXPECT_TRUE(warns(result, "1 of 4 depth pictures have no pose, colour or label within 0.02 s")) << result.err;
    EXPECT_EQ(run_of(w.folder / "out")["results"]["colored_frames"], 3);
    EXPECT_EQ(w.grid(result).colors[0], 200);
    EXPECT_TRUE(warns(w.fuse(lens), "TUM RGB-D's own pictures have 5000 units a metre"));
    // lists say times of any names
    std::string list = "# depth maps\n# timestamp filename\n";
    for (int i = 0; i < 3; ++i) {
        const std::string name = fmt::format("shots/{}.png", i);
        w.put_png(name, 16, PngFile::kGray, far);
        list += fmt::format("{:.4f} {}\n", 1305031110 + 0.05 * i, name);
    }
    fs::remove_all(w.in("depth"));
    fs::create_directories(w.in("depth"));
    fs::rename(w.in("shots"), w.in("depth/shots"));
    w.put("depth.txt", std::regex_replace(list, std::regex("shots/"), "depth/shots/"));
    w.expect_wall(w.fuse(lens + " --depth-scale 0.0002"));
    w.put("depth.txt", "1305031110.0 ../x.png\n");
    EXPECT_NE(w.fuse(lens).err.find("depth.txt' line 1: expected a path inside the folder"), std::string::npos);
    w.put("depth.txt", "5.0 depth/shots/0.png\n");
    EXPECT_NE(w.fuse(lens).err.find("expected names or times in seconds of one clock"), std::string::npos);
}

TEST(CliFuse, class_numbers_come_from_every_kind_of_label_picture)
{
    const Wall w;
    w.put_poses();
    w.put_all_depth();
    const auto fill = [&](int bits, int kind, const Wall::Rows& pixel, const std::string& palette = "") {
        for (size_t i = 0; i < 3; ++i)
            w.put_png(Wall::name(i, "label"), bits, kind, pixel, 1, palette);
    };
    const auto number = [](uint16_t left, uint16_t right) {
        return [=](uint32_t x, uint32_t) { return two_bytes(x < 40 ? left : right); };
    };
    const auto byte = [](uint8_t left, uint8_t right) {
        return [=](uint32_t x, uint32_t) { return std::string(1, char(x < 40 ? left : right)); };
    };
    fill(8, PngFile::kGray, byte(2, 13));
    const std::map<int, size_t> expect = w.labels(w.fuse(""));
    EXPECT_EQ(expect.size(), 2u);
    fill(16, PngFile::kGray, number(2, 13));
    EXPECT_EQ(w.labels(w.fuse("")), expect);
    fill(8, PngFile::kPalette, byte(2, 13), std::string(3 * 20, '\x55')); // whatever the colours
    EXPECT_EQ(w.labels(w.fuse("")), expect);
    fill(16, PngFile::kGray, number(65535, 13)); // nothing on the left
    EXPECT_EQ(w.labels(w.fuse("")).count(2), 0u);

    fill(8, PngFile::kGray, byte(11, 26)); // building and car of Cityscapes; 11 is person here
    const ProgramResult foreign = w.fuse("");
    EXPECT_EQ(foreign.code, 3);
    EXPECT_NE(foreign.err.find("unknown labels: 26 (7200 pixels); --map says what they are; found are 11 "
                               "person (7200 pixels), 26 (7200 pixels, unknown)"),
              std::string::npos)
        << foreign.err;
    EXPECT_NE(foreign.err.find("cityscapes"), std::string::npos) << foreign.err;
    EXPECT_EQ(w.labels(w.fuse("--map cityscapes")), expect);
    fill(16, PngFile::kGray, number(300, 301));
    w.folder.put("map.json", R"({"300": "building", "301": "car"})");
    EXPECT_EQ(w.labels(w.fuse("--map " + (w.folder / "map.json").string())), expect);
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
