// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// `semrover view`: pictures with and without a window, voxels that are clicked and painted, paths that `render` reads
#include "engine/scene/palette.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"
#include "tools/trajectory/camera_path.h"

#include <cmath>
#include <cstring>
#include <set>
#include <unistd.h>

namespace semrover {
namespace cli_view_test {

constexpr uint32_t kWidth = 160, kHeight = 104;
constexpr std::array<uint8_t, 3> kSky = {158, 189, 219};
const std::string kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
const std::string kCamera = " --at -1.5,2.4,2 --pitch -15";

// of the validation that the loader puts below the viewer
const std::string kValidated = "env VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation "
                               "VK_LAYER_ENABLES=VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT ";

// a road with a wall at its end, in one tile
VoxelGrid road()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < 8; ++i)
        for (int32_t j = 0; j < 8; ++j)
            for (int32_t k = 0; k < (i == 7 ? 3 : 1); ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(i == 7 ? 3 : 0);
            }
    return grid;
}

double share_of(const ImageRgb8& image, const std::array<uint8_t, 3>& color)
{
    size_t same = 0;
    for (size_t n = 0; n < image.pixels.size(); n += 3)
        same += std::abs(image.pixels[n] - color[0]) <= 1 && std::abs(image.pixels[n + 1] - color[1]) <= 1 &&
                std::abs(image.pixels[n + 2] - color[2]) <= 1;
    return 3.0 * double(same) / double(image.pixels.size());
}

double mean_difference(const ImageRgb8& a, const ImageRgb8& b)
{
    EXPECT_EQ(a.pixels.size(), b.pixels.size());
    double sum = 0;
    for (size_t n = 0; n < std::min(a.pixels.size(), b.pixels.size()); ++n)
        sum += std::abs(a.pixels[n] - b.pixels[n]);
    return sum / double(a.pixels.size());
}

class CliView : public testing::Test {
  protected:
    CliView() { EXPECT_TRUE(write_grid(folder_ / "road.sgrid", road())); }

    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string arguments(const std::string& more, const char* grid = "road.sgrid") const
    {
        std::string line = fmt::format("view {} -m {} --steps 1 --radius 2 --json {}", path(grid), kModel, more);
        if (more.find("-W ") == std::string::npos)
            line += fmt::format(" -W {} -H {}", kWidth, kHeight);
        return line + (more.find("--at") == std::string::npos ? kCamera : "");
    }
    // Runs it with validation, which prints to standard output. environment: in front
    Json view(const std::string& more, const std::string& environment = "") const
    {
        const ProgramResult r = run_program_line(kValidated + environment + SEMROVER_BINARY, arguments(more));
        EXPECT_EQ(r.code, 0) << r.err;
        for (const char* word : {"VUID", "Validation", "SYNC-HAZARD"})
            EXPECT_EQ((r.out + r.err).find(word), std::string::npos) << r.out << r.err;
        return json_of(r.out);
    }
    ImageRgb8 picture(std::string_view name) const
    {
        auto image = read_png_rgb8(folder_ / name);
        EXPECT_TRUE(image) << image.error().message;
        return image ? *std::move(image) : ImageRgb8();
    }

    ScratchFolder folder_;
};

TEST_F(CliView, a_screenshot_has_splats_and_panels)
{
    const Json json = view("--no-panels --screenshot " + path("bare.png"));
    EXPECT_EQ(json["tiles_generated"], 1);
    EXPECT_EQ(json["splats"], 20 * road().cells.size());
    const ImageRgb8 bare = picture("bare.png");
    ASSERT_EQ(bare.width, kWidth);
    ASSERT_EQ(bare.height, kHeight);
    EXPECT_GT(share_of(bare, kSky), 0.1);
    EXPECT_LT(share_of(bare, kSky), 0.8);
    const std::string line = arguments("--no-panels --screenshot " + path("bare.png"));
    expect_error(semrover_program(line), 2, "-y replaces it");

    view("--screenshot " + path("panels.png"));
    EXPECT_GT(mean_difference(bare, picture("panels.png")), 20); // they are dark, and cover most of so small a picture
}

TEST_F(CliView, a_folder_of_tiles_is_seen_as_the_grid_that_it_was_cut_from)
{
    ASSERT_EQ(semrover_program(fmt::format("tile {} -o {} --tile-size 2.4", path("road.sgrid"), path("tiles"))).code,
              0);
    for (const char* grid : {"road.sgrid", "tiles"}) {
        const std::string out = path(grid) + ".png";
        ASSERT_EQ(semrover_program(arguments("--no-panels --screenshot " + out, grid)).code, 0);
    }
    EXPECT_EQ(picture("road.sgrid.png").pixels, picture("tiles.png").pixels);
    std::filesystem::remove(folder_ / "tiles" / "index.json");
    expect_error(semrover_program(arguments("--screenshot x.png", "tiles")), 3, "index.json");
}

TEST_F(CliView, a_painted_cell_changes_the_picture_until_it_is_undone)
{
    folder_.put("script", fmt::format("wait\nclick 80 70 # the road\nshot {0}/clicked.png\nlabel car\nreach 1\npaint\n"
                                      "wait\nshot {0}/painted.png\nshow labels\nshot {0}/labels.png\n"
                                      "show cells\nshot {0}/cells.png\nshow depth\nshot {0}/depth.png\n"
                                      "show normal\nshot {0}/normal.png\ngrid {0}/painted.sgrid\n"
                                      "show color\nreach 0\nundo\nwait\nshot {0}/undone.png\nquit\n",
                                      folder_.path().string()));
    const Json json = view("--no-panels --script " + path("script") + " --screenshot " + path("never.png"));
    EXPECT_EQ(json["cell"]["label"], "road");
    EXPECT_EQ(json["cell"]["points"], 20);
    EXPECT_EQ(json["cell"]["tile"], Json({0, 0}));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "never.png")); // the script had quit

    const ImageRgb8 before = picture("clicked.png");
    EXPECT_GT(mean_difference(before, picture("painted.png")), 2);
    EXPECT_EQ(mean_difference(before, picture("undone.png")), 0); // the same bytes again
    EXPECT_GT(share_of(picture("labels.png"), kSky), 0.1);
    EXPECT_GT(share_of(picture("labels.png"), kPalette[0].color), 0.1);
    EXPECT_GT(share_of(picture("labels.png"), kPalette[3].color), 0.02);
    std::set<std::vector<uint8_t>> different;
    for (const char* name : {"clicked.png", "labels.png", "cells.png", "depth.png", "normal.png"})
        different.insert(picture(name).pixels);
    EXPECT_EQ(different.size(), 5u);

    const auto painted = read_grid(folder_ / "painted.sgrid");
    ASSERT_TRUE(painted) << painted.error().message;
    const auto cell = json["cell"]["ijk"].get<Cell>();
    size_t cars = 0;
    for (size_t c = 0; c < painted->cells.size(); ++c)
        cars += painted->labels[c] == 13;
    EXPECT_EQ(painted->labels[*find_cell(*painted, cell)], 13);
    EXPECT_GE(cars, 6u);
    EXPECT_LE(cars, 18u);
}

TEST_F(CliView, a_saved_path_shows_in_render_what_the_viewer_showed)
{
    folder_.put("script", fmt::format("wait\nrecord on\nframes 2\nfly 0.4 0.2 0.3 3\norbit 9 -4\nshot {0}/seen.png\n"
                                      "record off\nfly 1 0 0 2\npath {0}/a.tum\npath {0}/a.json\ngrid {0}/made.sgrid\n"
                                      "quit\n",
                                      folder_.path().string()));
    const Json json = view("--no-panels --fov-x 70 --script " + path("script") + " --screenshot " + path("never.png"));
    EXPECT_EQ(json["path_cameras"], 5); // where it started, three of the flight, one of the turn
    const Intrinsics lens = pinhole_from_fov(70, kWidth, kHeight);
    const auto tum = read_camera_path(folder_ / "a.tum", lens), json_path = read_camera_path(folder_ / "a.json", lens);
    ASSERT_TRUE(tum && json_path);
    ASSERT_EQ(tum->frames.size(), 5u);
    ASSERT_EQ(json_path->frames.size(), 5u);
    for (size_t f = 0; f < 5; ++f) {
        const Rigid &a = tum->frames[f].pose.world_to_camera, &b = json_path->frames[f].pose.world_to_camera;
        for (size_t n = 0; n < a.size(); ++n)
            EXPECT_NEAR(a[n], b[n], 1e-9);
        EXPECT_NEAR(json_path->frames[f].intrinsics.fx, lens.fx, 1e-9);
    }
    for (const char* name : {"a.tum", "a.json"}) {
        const std::string out = path(name) + ".frames";
        const ProgramResult r = semrover_program(
            fmt::format("render {} --path {} -o {} {} --splat-radius auto --background 158,189,219 --quiet",
                        path("made.sgrid"), path(name), out,
                        name == std::string("a.tum") ? fmt::format("-W {} -H {} --fov-x 70", kWidth, kHeight) : ""));
        ASSERT_EQ(r.code, 0) << r.err;
        const auto rendered = read_png_rgb8(out + "/color/000004.png");
        ASSERT_TRUE(rendered);
        EXPECT_LT(mean_difference(*rendered, picture("seen.png")), 0.6);
        EXPECT_GT(mean_difference(*rendered, *read_png_rgb8(out + "/color/000000.png")), 5);
    }
}

TEST_F(CliView, a_view_is_refined)
{
    put_renderer_model(folder_ / "renderer");
    folder_.put("script", fmt::format("wait\nshot {0}/splats.png\nrefine\nwait\nshot {0}/refined.png\n"
                                      "fly 0.1 0 0 1\nshot {0}/moved.png\nquit\n",
                                      folder_.path().string()));
    view("--no-panels -W 56 -H 40 --refine-steps 2 --renderer " + path("renderer") + " --script " + path("script") +
         " --screenshot " + path("never.png"));
    EXPECT_GT(mean_difference(picture("splats.png"), picture("refined.png")), 10);
    EXPECT_LT(mean_difference(picture("splats.png"), picture("moved.png")), 10); // the frame is of one camera
    const ProgramResult none = semrover_program(arguments("--script " + path("script") + " --screenshot x.png -y"));
    EXPECT_EQ(none.code, 3) << none.err; // the model of points has no renderer
    EXPECT_NE(none.err.find("script':3: "), std::string::npos) << none.err;
}

TEST_F(CliView, scripts_and_inputs_that_mean_nothing_are_refused_with_their_line)
{
    for (const auto& [text, error] : {std::pair{"wait\nfly 1 2", ":2: fly takes 4 words"},
                                      {"click 1 nan", ":1: click: expected a number"},
                                      {"\n\njump", ":3: there is no step 'jump'"},
                                      {"show nothing", ":1: show: expected one of color"},
                                      {"label x", ":1: label: "},
                                      {"record maybe", ":1: record: expected one of off, on"},
                                      {"quit now", ":1: quit takes 0 words"}}) {
        folder_.put("script", text);
        expect_error(semrover_program(arguments("--screenshot x.png --script " + path("script"))), 3, error);
    }
    expect_error(semrover_program(arguments("--screenshot x.png --at 1,2")), 2, "--at takes X,Y,Z");
    expect_error(semrover_program(arguments("--screenshot x.png --at 1,2,3,4")), 2, "--at takes X,Y,Z");
    expect_error(semrover_program(arguments("--screenshot /nonesuch/x.png")), 3, "/nonesuch");
    expect_error(semrover_program("view /nonesuch.sgrid --screenshot x.png -m " + kModel), 3, "no such file");
    const ProgramResult no_display =
        run_program_line("env -u DISPLAY -u WAYLAND_DISPLAY " SEMROVER_BINARY, arguments(""));
    expect_error(no_display, 4, "--screenshot needs no window");
}

// what Xvfb keeps in a file (its option -fbdir): a header of sizes, then pixels of blue, green, red, nothing
ImageRgb8 screen_of(const std::filesystem::path& file)
{
    const std::string bytes = contents(file);
    const auto word = [&](size_t n) {
        uint32_t value = 0;
        std::memcpy(&value, bytes.data() + 4 * n, 4);
        return __builtin_bswap32(value);
    };
    ImageRgb8 image;
    if (bytes.size() < 100)
        return image;
    image.width = word(4);
    image.height = word(5);
    const size_t row_bytes = word(12), start = word(0) + 12 * word(19);
    EXPECT_GE(bytes.size(), start + row_bytes * image.height);
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x)
            for (const size_t c : {2, 1, 0})
                image.pixels.push_back(uint8_t(bytes[start + y * row_bytes + 4 * x + c]));
    return image;
}

// the part of a screen where a window is without a window manager
ImageRgb8 corner_of(const ImageRgb8& screen, uint32_t width, uint32_t height)
{
    ImageRgb8 part{.width = width, .height = height, .pixels = {}};
    for (uint32_t y = 0; y < height; ++y) {
        const auto row = screen.pixels.begin() + ptrdiff_t(3 * y * screen.width);
        part.pixels.insert(part.pixels.end(), row, row + 3 * width);
    }
    return part;
}

TEST_F(CliView, a_window_shows_what_a_screenshot_shows)
{
    if (std::system("command -v Xvfb >/dev/null"))
        GTEST_SKIP() << "no Xvfb";
    folder_.put("script", fmt::format("wait\nfly 0.3 0 0 3\nclick 80 70\nlabel building\npaint\nwait\nshot {0}/w.png\n",
                                      folder_.path().string()));
    const std::string headless = "--no-panels --script " + path("script") + " --screenshot " + path("alone.png");
    view(headless);
    std::filesystem::rename(folder_ / "w.png", folder_ / "alone_shot.png");
    // The viewer runs until it is told to end, so that its window is there when the screen is looked at.
    const std::string run = "cd " + folder_.path().string() + R"( && mkdir screen
Xvfb -displayfd 3 -fbdir screen -screen 0 300x200x24 3>display 2>/dev/null &
server=$!
until test -s display; do sleep 0.1; done
export DISPLAY=:$(cat display)
)" + kValidated + SEMROVER_BINARY " " +
                            arguments("--no-panels --budget 300 --script " + path("script")) +
                            R"( >out 2>err </dev/null &
viewer=$!
for quarter in $(seq 1200); do test -s w.png && break; kill -0 $viewer || break; sleep 0.25; done
sleep 1
cp screen/Xvfb_screen0 seen
kill $viewer; wait $viewer; echo $? >code
kill $server; wait $server
)";
    folder_.put("run.sh", run);
    EXPECT_EQ(std::system(("sh " + path("run.sh") + " >/dev/null 2>&1").c_str()), 0);
    EXPECT_EQ(contents(folder_ / "code"), "130\n") << contents(folder_ / "err");
    EXPECT_EQ(contents(folder_ / "out"), ""); // nothing of the validation
    const ImageRgb8 shot = picture("w.png"), screen = screen_of(folder_ / "seen");
    EXPECT_EQ(mean_difference(shot, picture("alone_shot.png")), 0);
    EXPECT_LT(share_of(shot, kSky), 0.9);
    ASSERT_EQ(screen.width, 300u);
    EXPECT_LT(mean_difference(corner_of(screen, kWidth, kHeight), shot), 0.5);
}

} // namespace cli_view_test
} // namespace semrover
