// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "engine/scene/grid.h"
#include "tests/support/json_text.h"
#include "tests/support/png_file.h"
#include "tests/support/program.h"

#include <array>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <regex>

namespace semrover {
namespace cli_fuse_pictures_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

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
    Json run() const { return json_of(contents(folder / "out/run.json")); }
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

TEST(CliFusePictures, depth_may_be_along_the_ray_in_carlas_colours_or_in_arrays)
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
    EXPECT_EQ(w.run()["settings"]["depth_kind"], "ray");
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

TEST(CliFusePictures, intrinsics_colours_and_labels_of_other_sizes_are_brought_to_depth)
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

TEST(CliFusePictures, intrinsics_of_colmap_and_kitti_are_used_and_colmaps_names_find_the_pictures)
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
    EXPECT_EQ(w.run()["results"]["frames"], 3);
    // a lens that is almost a pinhole sees almost the same wall
    w.folder.put("colmap/cameras.txt", "1 OPENCV 160 120 120 120 80 60 0.01 0 0 0\n");
    w.expect_wall(w.fuse("-y --default-label building --poses " + (w.folder / "colmap").string()));

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

// the depth map of COLMAP's dense reconstruction: a wall that is `metres` away
std::string colmap_map(float metres, int channels = 1)
{
    const std::vector<float> values(size_t(Wall::kWidth) * Wall::kHeight, metres);
    return fmt::format("{}&{}&{}&", Wall::kWidth, Wall::kHeight, channels) +
           std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
}

TEST(CliFusePictures, maps_of_colmaps_dense_reconstruction_are_depth)
{
    const Wall w;
    const auto map = [](int i, const char* kind) {
        return fmt::format("stereo/depth_maps/drive/{}.jpg.{}.bin", i, kind);
    };
    std::string images;
    for (int i = 0; i < 3; ++i) {
        images += fmt::format("{} 0.5 0.5 -0.5 0.5 0 1.5 0 1 drive/{}.jpg\n\n", i + 1, i);
        w.put(map(i, "photometric"), colmap_map(i == 2 ? 6 : 3));
        if (i < 2) // where both are there, it is the consistent one
            w.put(map(i, "geometric"), colmap_map(6));
    }
    w.put("sparse/cameras.txt", "1 PINHOLE 80 60 60 60 40 30\n");
    w.put("sparse/images.txt", images);
    const std::string options = "--default-label building --poses " + w.in("sparse").string();
    w.expect_wall(w.fuse(options));
    EXPECT_EQ(w.run()["results"]["frames"], 3);
    w.put(map(1, "geometric"), colmap_map(6, 3));
    EXPECT_NE(w.fuse(options).err.find("a map of 3 channels, expected 1: depth"), std::string::npos);
    w.put(map(1, "geometric"), colmap_map(6).substr(0, 999));
    EXPECT_NE(w.fuse(options).err.find("bytes of pixels, expected 19200"), std::string::npos);
    w.put(map(1, "geometric"), "80&60");
    EXPECT_NE(w.fuse(options).err.find("expected COLMAP's WIDTH&HEIGHT&CHANNELS&"), std::string::npos);
}

TEST(CliFusePictures, poses_in_a_file_each_find_the_pictures_of_their_names)
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
    EXPECT_EQ(w.run()["results"]["frames"], 2);
}

TEST(CliFusePictures, pictures_named_by_time_meet_the_poses_nearest_in_time)
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
    EXPECT_EQ(w.run()["results"]["colored_frames"], 3);
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

TEST(CliFusePictures, class_numbers_come_from_every_kind_of_label_picture)
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

} // namespace cli_fuse_pictures_test
} // namespace semrover
