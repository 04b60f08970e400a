// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/cell_objects.h"
#include "runtime/base/dtype.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace semrover {
namespace engine_objects_test {

constexpr uint8_t kBuilding = 2, kCar = 13;

SceneObject car(uint32_t id, double x, double y, double heading)
{
    return {.id = id, .label = kCar, .center = {x, y, 0.75}, .size = {4.2, 1.8, 1.5}, .heading = heading};
}

const std::string kOne = R"({"id": 3, "class": "car", "center": [1, 2, 3], "size": [4, 2, 1.5], "heading": 0.5)";

Result<std::vector<SceneObject>> parse(const std::string& list, const std::string& more = "")
{
    const std::string text = R"({"format": "semrover.objects", "version": 1)" + more + ", \"objects\": [" + list + "]}";
    return parse_objects(*parse_json(text, "o"), "o");
}

TEST(engine_objects, what_is_written_is_read_and_written_again_with_the_same_bytes)
{
    const ScratchFolder folder;
    std::vector<SceneObject> objects = {car(7, 1.25, -3.5, 0.75), car(2, -100000, 0, -3.14159)};
    objects[0].tint = {0.5, 0.25, 1};
    objects[1].part = true;
    ASSERT_TRUE(write_objects(folder / "a.json", objects));
    const auto read = read_objects(folder / "a.json");
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->size(), 2u);
    EXPECT_EQ((*read)[0].id, 7u);
    EXPECT_EQ((*read)[0].label, kCar);
    EXPECT_EQ((*read)[0].center, objects[0].center);
    EXPECT_EQ((*read)[0].size, objects[0].size);
    EXPECT_EQ((*read)[0].heading, 0.75);
    EXPECT_EQ((*read)[0].tint, objects[0].tint);
    EXPECT_FALSE((*read)[1].tint);
    EXPECT_FALSE((*read)[0].part);
    EXPECT_TRUE((*read)[1].part);
    ASSERT_TRUE(write_objects(folder / "b.json", *read));
    EXPECT_EQ(contents(folder / "a.json"), contents(folder / "b.json"));
    ASSERT_TRUE(write_objects(folder / "none.json", {}));
    EXPECT_TRUE(read_objects(folder / "none.json")->empty());
}

TEST(engine_objects, a_box_has_its_front_along_the_heading)
{
    for (const double heading : {-3.0, -0.5, 0.0, 1.0, 4.0}) {
        const SceneObject o = car(1, 20, -7, heading);
        const Rigid to_world = box_to_world(o);
        const Point3 front = transform(to_world, {2, 0, 0.5});
        EXPECT_NEAR(front[0], 20 + 2 * std::cos(heading), 1e-14);
        EXPECT_NEAR(front[1], -7 + 2 * std::sin(heading), 1e-14);
        EXPECT_EQ(front[2], 1.25);
        const Point3 there = place_in(o, transform(to_world, {1, 2, 3}));
        for (size_t a = 0; a < 3; ++a)
            EXPECT_NEAR(there[a], 1 + double(a), 1e-13);
    }
}

TEST(engine_objects, a_tint_may_be_a_hexadecimal_colour_and_may_be_missing)
{
    const auto read = parse(kOne + R"(, "tint": "#ff8000"}, {"id": 4, "class": "traffic light", "center": [0, 0, 0],
        "size": [1, 1, 1], "heading": 0, "tint": null})");
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ((*read)[0].tint, (std::array<double, 3>{1, 128 / 255.0, 0}));
    EXPECT_EQ((*read)[1].label, 6);
    EXPECT_FALSE((*read)[1].tint);
}

TEST(engine_objects, what_is_no_object_is_refused_with_its_number)
{
    EXPECT_TRUE(says(parse(kOne + "}," + kOne + "}"), "o: object 2: id 3 is given twice"));
    EXPECT_TRUE(says(parse("7"), "object 1: expected an object, found number"));
    EXPECT_TRUE(says(parse(kOne + R"(, "colour": 1})"), "unknown key 'colour'"));
    EXPECT_TRUE(says(parse(kOne + R"(, "part": 1})"), "part: expected true or false, found 1"));
    EXPECT_FALSE((*parse(kOne + R"(, "part": false})"))[0].part);
    EXPECT_TRUE(says(parse(kOne + R"(, "tint": [0, 0, 1.5]})"), "tint: expected a number from 0 to 1, found 1.5"));
    for (const char* tint : {"\"#12345\"", "\"#12345g\"", "\"red\"", "\"#+12345\""})
        EXPECT_TRUE(says(parse(kOne + ", \"tint\": " + tint + "}"), "tint: expected #rrggbb")) << tint;
    const auto refused = [](const std::string& from, const std::string& to, std::string_view text) {
        std::string one = kOne + "}";
        one.replace(one.find(from), from.size(), to);
        EXPECT_TRUE(says(parse(one), text)) << one;
    };
    refused("3", "-3", "id: expected a whole number");
    refused("3", "4294967296", "id: expected a whole number");
    refused("car", "cart", "there is no class 'cart'");
    refused("[1, 2, 3]", "[1, 2]", "center: expected an array of 3 numbers");
    refused("[1, 2, 3]", "[1, 2, 3e7]", "center: expected a number from -1000000 to 1000000");
    refused("[4, 2, 1.5]", "[4, 0, 1.5]", "size: expected a number from 0.001 to 10000, found 0");
    refused("[4, 2, 1.5]", "[4, 2, \"1\"]", "size: expected a number, found string");
    refused(", \"heading\": 0.5", "", "heading is missing");
    refused("0.5", "1e9", "heading: expected a number from -1000 to 1000");
    EXPECT_TRUE(says(parse_objects(Json::array(), "o"), "\"format\": \"semrover.objects\""));
    EXPECT_TRUE(says(parse("", ", \"more\": 1"), "unknown key 'more'"));
    EXPECT_TRUE(says(parse_objects(Json{{"format", "semrover.objects"}, {"version", 2}}, "o"), "expected 1, found 2"));
}

// a slab of cars and one of buildings above it
VoxelGrid slab()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 1;
    for (int32_t i = -20; i < 20; ++i)
        for (int32_t j = -10; j < 10; ++j)
            for (int32_t k = 0; k < 2; ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(k ? kBuilding : kCar);
                for (int c : {0, 1, 2})
                    grid.colors.push_back(uint8_t(c ? 10 * c : i + 20));
            }
    grid.points.assign(grid.cells.size() * 3, float_to_half(0));
    grid.generated.assign(grid.cells.size(), 1);
    return grid;
}

TEST(engine_objects, cells_belong_to_the_box_of_their_class_in_which_they_lie_deepest)
{
    const VoxelGrid grid = slab();
    const double turn = std::numbers::pi / 6;
    const std::vector<SceneObject> objects = {car(0, -4, 0, turn), car(1, 0.5, 0, turn), car(2, 900, 0, 0)};
    const std::vector<int32_t> owners = *objects_of_cells(grid, objects);
    size_t owned = 0;
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        const auto center = cell_center(grid.cells[v], grid.voxel_size);
        double best = -1.5;
        int32_t expected = kNoObject;
        for (int32_t o = 0; o < 2 && grid.labels[v] == kCar; ++o) {
            const double x = center[0] - objects[size_t(o)].center[0], y = center[1];
            const double ahead = x * std::cos(turn) + y * std::sin(turn),
                         left = y * std::cos(turn) - x * std::sin(turn);
            const double depth = std::min({2.1 - std::abs(ahead), 0.9 - std::abs(left), 0.75 - std::abs(0.3 - 0.75)});
            if (depth > best) {
                best = depth;
                expected = o;
            }
        }
        ASSERT_EQ(owners[v], expected) << v;
        owned += expected != kNoObject;
    }
    EXPECT_GT(owned, 150u);
    EXPECT_LT(owned, 500u);
}

// as objects_of_cells, by comparing every object with every voxel of its class
std::vector<int32_t> owners_by_product(const VoxelGrid& grid, const std::vector<SceneObject>& objects)
{
    const double size = double(grid.voxel_size);
    std::vector<int32_t> owners;
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        const auto& [i, j, k] = grid.cells[v];
        double best = -kObjectReach;
        owners.push_back(kNoObject);
        for (size_t o = 0; o < objects.size(); ++o) {
            const auto place = place_in(objects[o], {(i + 0.5) * size, (j + 0.5) * size, (k + 0.5) * size});
            double depth = 1e9;
            for (size_t a = 0; a < 3; ++a)
                depth = std::min(depth, objects[o].size[a] / 2 - std::abs(place[a]));
            if (objects[o].label == grid.labels[v] && depth > best) {
                best = depth;
                owners.back() = int32_t(o);
            }
        }
    }
    return owners;
}

TEST(engine_objects, owners_are_those_of_the_product_of_all_objects_and_cells)
{
    std::mt19937 random(5);
    const auto number = [&](double low, double high) { return low + (high - low) * double(random()) / 4294967296.0; };
    for (const float voxel_size : {0.25f, 0.6f, 2.f}) {
        VoxelGrid grid;
        grid.voxel_size = voxel_size;
        for (int n = 0; n < 6000; ++n) {
            grid.cells.push_back({int32_t(number(-60, 60)), int32_t(number(-40, 40)), int32_t(number(-2, 9))});
            grid.labels.push_back(random() % 2 ? kBuilding : kCar);
        }
        sort_cells(grid);
        std::vector<SceneObject> objects;
        for (uint32_t n = 0; n < 200; ++n) {
            const double longest = n % 10 ? 6 : 60;
            objects.push_back({.id = n,
                               .label = n % 3 ? kBuilding : kCar,
                               .center = {number(-70, 70), number(-50, 50), number(-1, 4)},
                               .size = {number(0.1, longest), number(0.1, longest / 3), number(0.1, 8)},
                               .heading = n % 7 ? number(-4, 4) : std::numbers::pi / 2 * double(n % 4)});
        }
        objects.push_back(objects[1]); // of equals the first
        const auto owners = objects_of_cells(grid, objects);
        ASSERT_TRUE(owners);
        EXPECT_EQ(*owners, owners_by_product(grid, objects)) << voxel_size;
        EXPECT_GT(std::ranges::count_if(*owners, [](int32_t o) { return o != kNoObject; }), 100) << voxel_size;
        EXPECT_EQ(std::ranges::count(*owners, 200), 0);
    }
}

TEST(engine_objects, boxes_that_lie_over_too_many_cells_are_refused)
{
    const VoxelGrid grid = slab(); // 800 voxels of cars in 40 slices
    const SceneObject wide = {.id = 0, .label = kCar, .center = {}, .size = {100, 100, 2}, .heading = 0.3};
    std::vector<SceneObject> objects(3, wide);
    EXPECT_TRUE(objects_of_cells(grid, objects, 3 * 840));
    EXPECT_TRUE(
        says(objects_of_cells(grid, objects, 3 * 840 - 1),
             "object 3 of 3: the boxes so far lie over more than 2519 voxels of their classes, counted with each "
             "box; the grid has 1600 voxels"));
    EXPECT_TRUE(says(objects_of_cells(grid, objects, 840 + 40 - 1), "object 2 of 3"));
    objects.assign(1 << 20, car(0, 500, 0, 0)); // far from all voxels: nothing to compare
    EXPECT_TRUE(objects_of_cells(grid, objects, 0));
}

TEST(engine_objects, a_tint_is_the_median_of_the_lighter_two_fifths_of_the_objects_own_points)
{
    VoxelGrid grid = slab();
    std::vector<SceneObject> objects = {car(0, 0, 0, 0), car(1, 50, 0, 0)};
    objects[1].tint = {0, 1, 0};
    ASSERT_TRUE(tint_objects(objects, grid));
    ASSERT_TRUE(objects[0].tint);
    EXPECT_NEAR((*objects[0].tint)[0] * 255, 23, 1e-9); // 14 to 25 is red in all, 21 to 25 in the lighter part
    EXPECT_NEAR((*objects[0].tint)[1] * 255, 10, 1e-9);
    EXPECT_NEAR((*objects[0].tint)[2] * 255, 20, 1e-9);
    EXPECT_EQ(objects[1].tint, (std::array<double, 3>{0, 1, 0}));
    grid.generated.assign(grid.cells.size(), 0);
    objects[0].tint.reset();
    ASSERT_TRUE(tint_objects(objects, grid));
    EXPECT_FALSE(objects[0].tint);
}

TEST(engine_objects, a_part_owns_no_cells_and_is_that_of_those_up_to_60_cm_from_it)
{
    const VoxelGrid grid = slab();
    SceneObject window{.id = 1, .label = kCar, .center = {0.9, 0.3, 0.3}, .size = {1, 1, 0.6}, .heading = 0.3};
    window.part = true;
    const std::vector<SceneObject> objects = {window, car(0, 0, 0, 0)};
    EXPECT_EQ(*objects_of_cells(grid, objects), [&] {
        std::vector<int32_t> alone = *objects_of_cells(grid, std::span(objects).subspan(1));
        std::ranges::for_each(alone, [](int32_t& owner) { owner += owner != kNoObject; });
        return alone;
    }());
    const std::vector<int32_t> parts = *parts_of_cells(grid, objects);
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        const auto at = cell_center(grid.cells[v], grid.voxel_size);
        const auto p = place_in(window, {double(at[0]), double(at[1]), double(at[2])});
        const double depth = std::min({0.5 - std::abs(p[0]), 0.5 - std::abs(p[1]), 0.3 - std::abs(p[2])});
        ASSERT_EQ(parts[v], grid.labels[v] == kCar && depth > -0.6 ? 0 : kNoObject) << v;
    }
    EXPECT_GT(std::ranges::count(parts, 0), 8);
}

TEST(engine_objects, the_tint_of_a_part_is_the_median_of_the_points_in_its_box)
{
    VoxelGrid grid = slab();
    for (size_t v = 0; v < grid.cells.size(); ++v)
        grid.points[v * 3] = float_to_half(0.2f); // 0.2 m towards x of the voxel's centre
    std::vector<SceneObject> objects = {car(0, 0, 0, 0), car(1, 0, 0, 0), car(2, 0, 0, 0)};
    for (SceneObject& o : std::span(objects).subspan(1)) {
        o.part = true;
        o.size = {1.3, 0.4, 0.2};
        o.center = {0.5, 0.3, 0.3}; // points at x = -0.1, 0.5 and 1.1, red 20, 21, 22
    }
    objects[2].center[0] = 0.15; // between points that are 0.6 m apart
    objects[2].size[0] = 0.1;
    ASSERT_TRUE(tint_objects(objects, grid));
    EXPECT_NEAR((*objects[1].tint)[0] * 255, 20, 1e-9);
    EXPECT_FALSE(objects[2].tint);
}

} // namespace engine_objects_test
} // namespace semrover
