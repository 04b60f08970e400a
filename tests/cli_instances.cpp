// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/conditioning/cell_objects.h"
#include "engine/format/image.h"
#include "engine/scene/actors.h"
#include "runtime/base/dtype.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/scratch_folder.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <numbers>

namespace semrover {
namespace cli_instances_test {

namespace fs = std::filesystem;

constexpr double kMetre = 0.5; // from frame to frame
constexpr uint32_t kWidth = 96, kHeight = 64;

// a wall across the street behind a car: voxels of 0.5 m with points in the middle of the side that is seen
VoxelGrid wall_and_car()
{
    VoxelGrid grid;
    grid.voxel_size = 0.5f;
    grid.points_per_voxel = 16;
    const auto add = [&](int32_t i, int32_t j, int32_t k, uint8_t label) {
        grid.cells.push_back({i, j, k});
        grid.labels.push_back(label);
        grid.generated.push_back(1);
        for (int n = 0; n < 16; ++n) {
            const std::array<float, 3> p = {0, float(n % 4) * 0.125f - 0.1875f, float(n / 4) * 0.125f - 0.1875f};
            for (size_t a = 0; a < 3; ++a) {
                grid.points.push_back(float_to_half(p[a]));
                grid.colors.push_back(label == 13 ? 200 : 90);
            }
        }
    };
    for (int32_t j = -20; j < 20; ++j)
        for (int32_t k = 0; k < 12; ++k)
            add(40, j, k, 2);
    for (int32_t j = -2; j < 2; ++j)
        for (int32_t k = 0; k < 3; ++k)
            add(20, j, k, 13);
    sort_cells(grid);
    return grid;
}

// along x, 1 m above the ground, looking along x; a frame every 0.1 s
std::string path_of(int frames)
{
    std::string lines;
    for (int i = 0; i < frames; ++i)
        lines += fmt::format("{:.1f} {} 0 1 -0.5 0.5 -0.5 0.5\n", 0.1 * i, kMetre * i);
    return lines;
}

struct Scene {
    ScratchFolder folder;
    std::vector<SceneObject> objects = {
        {.id = 4, .label = 13, .center = {10.25, 0, 0.75}, .size = {0.5, 2, 1.5}, .heading = 0},
        {.id = 9, .label = 2, .center = {20.25, 0, 3}, .size = {0.5, 20, 6}, .heading = 0}};

    Scene()
    {
        EXPECT_TRUE(write_grid(folder / "scene.sgrid", wall_and_car()));
        EXPECT_TRUE(write_objects(folder / "scene.objects.json", objects));
        EXPECT_TRUE(write_file_atomically(folder / "path.tum", path_of(3)));
    }
    // the car drives 0.3 m to the left a frame
    void write_actors_file() const
    {
        Actor car{.id = 4, .label = 13, .size = objects[0].size, .from = ObjectOfScene(), .poses = {}};
        for (int i = 0; i < 3; ++i)
            car.poses.push_back({i * 100000, {1, 0, 0, 10.25, 0, 1, 0, 0.3 * i, 0, 0, 1, 0.75, 0, 0, 0, 1}});
        EXPECT_TRUE(write_actors(folder / "actors.json", {&car, 1}));
    }
    ProgramResult render(const char* out, const std::string& more) const
    {
        return semrover_program(
            fmt::format("render {} --path {} -W {} -H {} --fov-x 73 --splat-radius auto -q -o {} {}",
                        (folder / "scene.sgrid").string(), (folder / "path.tum").string(), kWidth, kHeight,
                        (folder / out).string(), more));
    }
};

struct FlowFile {
    std::vector<float> flow;
    std::vector<uint8_t> states;
};

FlowFile read_flow(const Path& folder, int number)
{
    FlowFile file;
    const auto bytes = read_file(folder / fmt::format("flow/{:06}.flo", number), 1 << 20);
    EXPECT_TRUE(bytes);
    file.flow.resize(size_t(kWidth) * kHeight * 2);
    EXPECT_EQ(bytes->size(), 12 + file.flow.size() * 4);
    std::memcpy(file.flow.data(), bytes->data() + 12, file.flow.size() * 4);
    const auto states = read_png_rgb8(folder / fmt::format("flow_state/{:06}.png", number));
    EXPECT_TRUE(states);
    for (size_t i = 0; i < states->pixels.size(); i += 3)
        file.states.push_back(states->pixels[i]);
    return file;
}

TEST(CliInstances, pictures_say_which_object_a_pixel_shows_and_a_run_that_was_stopped_goes_on)
{
    const Scene s;
    ASSERT_EQ(s.render("a", "--instances").code, 0);
    size_t cars = 0, walls = 0;
    const auto instance = read_png_gray16(s.folder / "a/instance/000000.png");
    const auto label = read_png_rgb8(s.folder / "a/label/000000.png");
    ASSERT_TRUE(instance && label);
    for (size_t i = 0; i < instance->pixels.size(); ++i) {
        const uint16_t number = instance->pixels[i];
        EXPECT_TRUE(number == 0 || number == 5 || number == 10) << number;
        EXPECT_TRUE(number == 0 || label->pixels[3 * i] == (number == 5 ? 13 : 2));
        cars += number == 5;
        walls += number == 10;
    }
    EXPECT_GT(cars, 60u);
    EXPECT_GT(walls, 600u);
    // what is there without it is not touched by it
    ASSERT_EQ(s.render("b", "").code, 0);
    EXPECT_FALSE(fs::exists(s.folder / "b/instance"));
    for (const char* kind : {"color", "depth", "label"})
        EXPECT_EQ(contents(s.folder / "a" / kind / "000002.png"), contents(s.folder / "b" / kind / "000002.png"));
    // a piece that is missing is made again, to the same bytes
    const std::string whole = contents(s.folder / "a/instance/000001.png");
    fs::remove(s.folder / "a/instance/000001.png");
    ASSERT_EQ(s.render("a", "--instances").code, 0);
    EXPECT_EQ(contents(s.folder / "a/instance/000001.png"), whole);
}

TEST(CliInstances, flow_follows_the_street_and_what_drives_on_it)
{
    const Scene s;
    s.write_actors_file();
    ASSERT_EQ(s.render("a", "--instances --flow flo --actors " + (s.folder / "actors.json").string()).code, 0);
    EXPECT_FALSE(fs::exists(s.folder / "a/flow/000002.flo"));                  // the last frame has none
    const double focal = kWidth / 2.0 / std::tan(73 * std::numbers::pi / 360); // checked below by the wall's flow
    for (int frame = 0; frame < 2; ++frame) {
        const FlowFile flow = read_flow(s.folder / "a", frame);
        const auto instance = read_png_gray16(s.folder / fmt::format("a/instance/{:06}.png", frame));
        ASSERT_TRUE(instance);
        size_t cars = 0, walls = 0, hidden = 0;
        double worst = 0;
        for (size_t i = 0; i < instance->pixels.size(); ++i) {
            const uint16_t number = instance->pixels[i];
            if (!number)
                continue;
            const double x = double(i % kWidth) + 0.5 - kWidth / 2.0, y = double(i / kWidth) + 0.5 - kHeight / 2.0;
            const double away = (number == 5 ? 10.25 : 20.25) - kMetre * frame, next = away - kMetre;
            // to the left by 0.3 m, which is -x
            const double u = (x * away - (number == 5 ? 0.3 * focal : 0)) / next - x, v = y * away / next - y;
            const double off = std::hypot(flow.flow[2 * i] - u, flow.flow[2 * i + 1] - v);
            // where splats of both reach the pixel the depth may be the other one's
            if (flow.states[i] == 1 && off < 1)
                worst = std::max(worst, off);
            cars += number == 5 && off < 0.05;
            walls += number == 10 && off < 0.05;
            hidden += flow.states[i] == 2;
        }
        EXPECT_GT(cars, 50u);
        EXPECT_GT(walls, 500u);
        EXPECT_GT(hidden, 0u); // the car comes before the wall
        EXPECT_LT(worst, 1);
    }
    // KITTI's file has the same numbers
    ASSERT_EQ(s.render("b", "--flow png --actors " + (s.folder / "actors.json").string()).code, 0);
    EXPECT_TRUE(fs::exists(s.folder / "b/flow/000001.png"));
    EXPECT_EQ(contents(s.folder / "a/flow_state/000001.png"), contents(s.folder / "b/flow_state/000001.png"));
}

TEST(CliInstances, an_actor_is_drawn_where_it_is_and_leaves_its_place)
{
    const Scene s;
    s.write_actors_file();
    const std::string actors = "--instances --actors " + (s.folder / "actors.json").string();
    ASSERT_EQ(s.render("still", "--instances").code, 0);
    ASSERT_EQ(s.render("moving", actors).code, 0);
    const auto mean_column = [&](const char* out, int frame) {
        const auto instance = read_png_gray16(s.folder / out / fmt::format("instance/{:06}.png", frame));
        EXPECT_TRUE(instance);
        double sum = 0, count = 0;
        for (size_t i = 0; i < instance->pixels.size(); ++i)
            if (instance->pixels[i] == 5) {
                sum += double(i % kWidth);
                ++count;
            }
        EXPECT_GT(count, 60);
        return sum / count;
    };
    EXPECT_EQ(contents(s.folder / "still/color/000000.png"), contents(s.folder / "moving/color/000000.png"));
    for (int frame = 1; frame < 3; ++frame)
        EXPECT_LT(mean_column("moving", frame), mean_column("still", frame) - 1.2 * frame) << frame;
    // in front of it the wall is seen where the car was
    EXPECT_NE(contents(s.folder / "still/color/000002.png"), contents(s.folder / "moving/color/000002.png"));
    EXPECT_NE(contents(s.folder / "still/depth/000002.png"), contents(s.folder / "moving/depth/000002.png"));
}

TEST(CliInstances, an_actor_may_have_a_grid_of_its_own)
{
    const Scene s;
    VoxelGrid box;
    box.voxel_size = 0.5f;
    box.points_per_voxel = 16;
    const VoxelGrid scene = wall_and_car();
    for (size_t i = 0; i < scene.cells.size(); ++i)
        if (scene.labels[i] == 13)
            append_cell(box, scene, i);
    for (Cell& cell : box.cells)
        cell[0] = 0; // in its own frame
    ASSERT_TRUE(write_grid(s.folder / "car.sgrid", box));
    Actor car{.id = 77, .label = 13, .size = {0.5, 2, 1.5}, .from = GridOfActor{s.folder / "car.sgrid"}, .poses = {}};
    car.poses.push_back({0, {1, 0, 0, 14, 0, 1, 0, 3, 0, 0, 1, 0, 0, 0, 0, 1}});
    ASSERT_TRUE(write_actors(s.folder / "own.json", {&car, 1}));
    ASSERT_EQ(s.render("own", "--instances --actors " + (s.folder / "own.json").string()).code, 0);
    const auto instance = read_png_gray16(s.folder / "own/instance/000001.png");
    ASSERT_TRUE(instance);
    EXPECT_GT(std::ranges::count(instance->pixels, 78), 20);
    EXPECT_GT(std::ranges::count(instance->pixels, 5), 60);
    std::ranges::fill(box.colors, uint8_t(7));
    ASSERT_TRUE(write_grid(s.folder / "car.sgrid", box));
    EXPECT_EQ(s.render("own", "--instances --actors " + (s.folder / "own.json").string()).code, 2);
}

TEST(CliInstances, what_is_missing_or_does_not_fit_is_said)
{
    const Scene s;
    s.write_actors_file();
    fs::remove(s.folder / "scene.objects.json");
    expect_error(s.render("x", "--instances"), 2, "--objects");
    std::vector<SceneObject> objects = s.objects;
    objects[0].id = 65535;
    ASSERT_TRUE(write_objects(s.folder / "far.json", objects));
    expect_error(s.render("x", "--instances --objects " + (s.folder / "far.json").string()), 3, "ids up to 65534");
    ASSERT_TRUE(write_objects(s.folder / "scene.objects.json", {&s.objects[1], 1}));
    expect_error(s.render("x", "--actors " + (s.folder / "actors.json").string()), 3, "4");
}

} // namespace cli_instances_test
} // namespace semrover
