// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/cell_objects.h"
#include "runtime/base/dtype.h"
#include "tests/says.h"
#include "tests/scratch_folder.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

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
    ASSERT_TRUE(write_objects(folder / "b.json", *read));
    EXPECT_EQ(contents(folder / "a.json"), contents(folder / "b.json"));
    ASSERT_TRUE(write_objects(folder / "none.json", {}));
    EXPECT_TRUE(read_objects(folder / "none.json")->empty());
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
    const std::vector<int32_t> owners = objects_of_cells(grid, objects);
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

TEST(engine_objects, a_tint_is_the_median_of_the_points_of_the_objects_own_cells)
{
    VoxelGrid grid = slab();
    std::vector<SceneObject> objects = {car(0, 0, 0, 0), car(1, 50, 0, 0)};
    objects[1].tint = {0, 1, 0};
    tint_objects(objects, grid);
    ASSERT_TRUE(objects[0].tint);
    EXPECT_NEAR((*objects[0].tint)[0] * 255, 19.5, 0.6); // i from -6 to 5, 20 added
    EXPECT_NEAR((*objects[0].tint)[1] * 255, 10, 1e-9);
    EXPECT_NEAR((*objects[0].tint)[2] * 255, 20, 1e-9);
    EXPECT_EQ(objects[1].tint, (std::array<double, 3>{0, 1, 0}));
    grid.generated.assign(grid.cells.size(), 0);
    objects[0].tint.reset();
    tint_objects(objects, grid);
    EXPECT_FALSE(objects[0].tint);
}

} // namespace engine_objects_test
} // namespace semrover
