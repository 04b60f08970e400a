// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/cell_objects.h"
#include "engine/conditioning/guessed_objects.h"
#include "tests/support/says.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <map>
#include <numbers>
#include <set>

namespace semrover {
namespace engine_guessed_objects_test {

constexpr uint8_t kRoad = 0, kSidewalk = 1, kBuilding = 2, kCar = 13;
constexpr double kPi = std::numbers::pi;

class Scene {
  public:
    void fill(uint8_t label, const Cell& low, const Cell& high) // inclusive
    {
        for (int32_t i = low[0]; i <= high[0]; ++i)
            for (int32_t j = low[1]; j <= high[1]; ++j)
                for (int32_t k = low[2]; k <= high[2]; ++k)
                    cells_[{i, j, k}] = label;
    }
    VoxelGrid grid() const
    {
        VoxelGrid g;
        g.voxel_size = 0.6f;
        for (const auto& [cell, label] : cells_) {
            g.cells.push_back(cell);
            g.labels.push_back(label);
        }
        return g;
    }
    // x and y exchanged, and y turned over: a quarter turn counterclockwise about the corner of voxel 0
    Scene turned() const
    {
        Scene s;
        for (const auto& [c, label] : cells_)
            s.cells_[{-c[1] - 1, c[0], c[2]}] = label;
        return s;
    }

  private:
    std::map<Cell, uint8_t> cells_;
};

UsualObjects usual()
{
    UsualObjects u;
    u[kBuilding] = {{11, 11, 16}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}}};
    u[kCar] = {{4.6, 2.1, 1.5}, {{0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}, {0.5, 0, 0}}};
    return u;
}

// along x: a road between two sidewalks, houses to its left with tops at 12 and 18 m, and three cars in a row
Scene street()
{
    Scene s;
    s.fill(kRoad, {0, -5, 0}, {59, 5, 0});
    s.fill(kSidewalk, {0, 6, 0}, {59, 9, 0});
    s.fill(kSidewalk, {0, -9, 0}, {59, -6, 0});
    s.fill(kBuilding, {0, 10, 0}, {17, 10, 19});
    s.fill(kBuilding, {18, 10, 0}, {35, 10, 29});
    s.fill(kBuilding, {36, 10, 0}, {59, 10, 21});
    for (int32_t car = 0; car < 3; ++car)
        s.fill(kCar, {2 + 9 * car, -4, 1}, {9 + 9 * car, -1, 3});
    s.fill(kCar, {10, -3, 1}, {10, -3, 1}); // the first two touch
    s.fill(kCar, {19, -3, 1}, {19, -3, 1}); // and the next two
    return s;
}

std::vector<SceneObject> guessed(const VoxelGrid& grid, const UsualObjects& usual, uint64_t seed)
{
    return *guess_objects(grid, usual, seed);
}

std::vector<SceneObject> of_class(const std::vector<SceneObject>& objects, uint8_t label)
{
    std::vector<SceneObject> found;
    std::ranges::copy_if(objects, std::back_inserter(found), [&](const SceneObject& o) { return o.label == label; });
    std::ranges::sort(found, {}, [](const SceneObject& o) { return o.center; });
    return found;
}

double apart(double a, double b) // of two angles
{
    return std::abs(std::remainder(a - b, 2 * kPi));
}

TEST(engine_guessed_objects, groups_are_connected_cells_of_one_label)
{
    Scene s;
    s.fill(kRoad, {0, 0, 0}, {3, 0, 0});
    s.fill(kCar, {1, 0, 1}, {1, 0, 1});
    s.fill(kCar, {2, 1, 2}, {2, 1, 2}); // over a corner
    s.fill(kCar, {4, 1, 2}, {4, 1, 2}); // a voxel further
    const VoxelGrid grid = s.grid();
    const auto groups = connected_groups(grid);
    ASSERT_EQ(groups.size(), 3u);
    std::vector<size_t> sizes;
    for (const auto& group : groups) {
        EXPECT_TRUE(std::ranges::is_sorted(group));
        sizes.push_back(group.size());
    }
    EXPECT_EQ(sizes, (std::vector<size_t>{4, 2, 1}));
}

TEST(engine_guessed_objects, a_row_of_cars_is_cut_where_they_touch)
{
    const VoxelGrid grid = street().grid();
    const auto cars = of_class(guessed(grid, usual(), 1), kCar);
    ASSERT_EQ(cars.size(), 3u);
    for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(cars[c].center[0], (2 + 9 * double(c) + 4) * 0.6, 0.4);
        EXPECT_NEAR(cars[c].center[1], -1.2, 0.01);
        EXPECT_NEAR(cars[c].size[0], 4.2, 0.7);
        EXPECT_LT(apart(cars[c].heading, 0), 0.05) << "the sidewalk is nearer on the side of -y, the right";
        EXPECT_TRUE(cars[c].tint);
    }
}

TEST(engine_guessed_objects, ground_has_one_colour_of_each_class_wherever_a_scene_begins)
{
    UsualObjects known = usual();
    known[kRoad] = {{10, 6, 3}, {{0.3, 0.3, 0.3}, {0.4, 0.4, 0.4}, {0.5, 0.5, 0.5}, {0.6, 0.6, 0.6}}};
    const VoxelGrid grid = street().grid();
    const auto found = guessed(grid, known, 1);
    const auto pieces = of_class(found, kRoad);
    ASSERT_EQ(pieces.size(), 2u); // in squares of 64 voxels, left and right of y = 0
    for (const SceneObject& o : pieces)
        EXPECT_EQ(o.tint, pieces[0].tint);
    EXPECT_TRUE(of_class(found, kSidewalk).empty()) << "whose usual colours are not known";
    const auto owners = *objects_of_cells(grid, found);
    for (size_t v = 0; v < owners.size(); ++v)
        if (grid.labels[v] == kRoad) {
            ASSERT_NE(owners[v], kNoObject);
            EXPECT_EQ(found[size_t(owners[v])].label, kRoad);
        }
    VoxelGrid part = grid; // without its first 20 metres
    for (size_t v = grid.cells.size(); v-- > 0;)
        if (grid.cells[v][0] < 33) {
            part.cells.erase(part.cells.begin() + ptrdiff_t(v));
            part.labels.erase(part.labels.begin() + ptrdiff_t(v));
        }
    const auto again = of_class(guessed(part, known, 1), kRoad);
    ASSERT_EQ(again.size(), 2u);
    for (size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(again[i].center, pieces[i].center);
        EXPECT_EQ(again[i].tint, pieces[i].tint);
    }
    std::set<std::array<double, 3>> drawn;
    for (uint64_t seed = 0; seed < 20; ++seed)
        drawn.insert(*of_class(guessed(grid, known, seed), kRoad)[0].tint);
    EXPECT_EQ(drawn.size(), 4u);
}

TEST(engine_guessed_objects, a_car_on_the_other_side_looks_the_other_way)
{
    Scene s = street();
    s.fill(kCar, {40, 2, 1}, {47, 4, 3});
    const auto cars = of_class(guessed(s.grid(), usual(), 1), kCar);
    ASSERT_EQ(cars.size(), 4u);
    EXPECT_LT(apart(cars[3].heading, kPi), 0.05);
}

TEST(engine_guessed_objects, houses_are_cut_where_their_height_steps_and_look_at_the_street)
{
    const auto houses = of_class(guessed(street().grid(), usual(), 1), kBuilding);
    ASSERT_EQ(houses.size(), 3u);
    const double edges[] = {0, 18, 36, 60};
    for (size_t h = 0; h < 3; ++h) {
        EXPECT_LT(apart(houses[h].heading, -kPi / 2), 0.1);
        EXPECT_NEAR(houses[h].center[0], (edges[h] + edges[h + 1]) / 2 * 0.6, 1.0);
        EXPECT_NEAR(houses[h].size[1], (edges[h + 1] - edges[h]) * 0.6, 1.5);
        EXPECT_NEAR(houses[h].size[0], 11, 1e-9) << "as deep as usual: of the back nothing is seen";
        EXPECT_NEAR(houses[h].center[1] - houses[h].size[0] / 2, 6.3, 1.0) << "the front is where the wall is";
    }
    EXPECT_NEAR(houses[1].size[2] - houses[0].size[2], 6, 0.01);
}

TEST(engine_guessed_objects, houses_have_rows_of_the_parts_that_are_usual_where_their_wall_is)
{
    UsualObjects known = usual();
    known[kBuilding].parts = UsualParts{{0.9, 1.2, 1.6}, {2.6, 3.1}, 1, {{0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}}};
    Scene s = street();
    s.fill(kSidewalk, {40, 10, 2}, {44, 10, 19}); // a hole in the wall
    const VoxelGrid grid = s.grid();
    const auto found = guessed(grid, known, 1), without = guessed(grid, usual(), 1);
    ASSERT_GT(found.size(), without.size() + 40);
    for (size_t o = 0; o < found.size(); ++o)
        EXPECT_EQ(found[o].part, o >= without.size()) << "parts come last";
    const std::vector<int32_t> owners = *objects_of_cells(grid, found);
    EXPECT_EQ(owners, *objects_of_cells(grid, without));
    std::map<double, std::map<double, double>> rows; // height -> across -> width
    for (const SceneObject& part : std::span(found).subspan(without.size())) {
        EXPECT_LT(apart(part.heading, -kPi / 2), 0.1);
        EXPECT_NEAR(part.center[1], 6.3, 0.3);
        EXPECT_EQ(part.id, uint32_t(&part - found.data()));
        EXPECT_TRUE(part.tint == known[kBuilding].parts->tints[0] || part.tint == known[kBuilding].parts->tints[1]);
        EXPECT_NEAR(part.size[1], 1.2, 1.2 * 0.15 + 1e-9);
        EXPECT_NEAR(part.size[2], 1.6, 1.6 * 0.15 + 1e-9);
        EXPECT_FALSE(part.center[0] > 24.6 && part.center[0] < 26.4 && part.center[2] > 2 && part.center[2] < 11);
        rows[part.center[2]][part.center[0]] = part.size[1];
    }
    EXPECT_GT(rows.size(), 8u);
    for (const auto& [height, row] : rows)
        for (auto a = row.begin(), b = std::next(a); b != row.end(); ++a, ++b)
            EXPECT_GT(b->first - a->first, (a->second + b->second) / 2 + 0.5) << "wall between two of a row";
    EXPECT_EQ(guessed(grid, known, 1).back().center, found.back().center);
    EXPECT_NE(guessed(grid, known, 2).back().center, found.back().center);
}

TEST(engine_guessed_objects, a_window_is_behind_every_balcony_and_others_in_its_row_and_column)
{
    UsualObjects known = usual();
    known[kBuilding].parts = UsualParts{{0.9, 1.2, 1.6}, {2.6, 3.1}, 1, {}};
    Scene s = street();
    const Cell corners[] = {{20, 8, 6}, {20, 8, 11}, {28, 8, 6}, {28, 8, 11}}; // floors at 3.9 and 6.9 m
    for (const Cell& c : corners)
        s.fill(kBuilding, c, {c[0] + 3, 9, c[2] + 1});
    s.fill(kBuilding, {36, 8, 2}, {59, 9, 3}); // an awning: no balcony
    std::vector<SceneObject> parts = guessed(s.grid(), known, 1);
    std::erase_if(parts, [](const SceneObject& o) { return !o.part; });
    for (const SceneObject& part : parts)
        EXPECT_FALSE(part.tint);
    for (const Cell& c : corners) {
        const double middle = (c[0] + 2) * 0.6, floor = (c[2] + 0.5) * 0.6;
        const auto behind = std::ranges::find_if(parts, [&](const SceneObject& o) {
            return std::abs(o.center[0] - middle) < 0.1 && std::abs(o.center[2] - o.size[2] / 2 - floor - 0.1) < 0.1;
        });
        ASSERT_NE(behind, parts.end()) << middle << " " << floor;
        const double top = behind->center[2] + behind->size[2] / 2;
        EXPECT_NEAR(top, floor + 0.9 + 1.6, 1.6 * 0.15 + 0.01);
        const auto in_row = std::ranges::count_if(parts, [&](const SceneObject& o) {
            return std::abs(o.center[2] + o.size[2] / 2 - top) < 1e-6 && o.center[0] > 10.8 && o.center[0] < 21.6;
        });
        EXPECT_GE(in_row, 3);
        const auto in_column = std::ranges::count_if(
            parts, [&](const SceneObject& o) { return std::abs(o.center[0] - behind->center[0]) < 1e-6; });
        EXPECT_GE(in_column, 4);
    }
}

TEST(engine_guessed_objects, every_cell_of_a_wall_belongs_to_the_house_around_it)
{
    const VoxelGrid grid = street().grid();
    const auto objects = guessed(grid, usual(), 1);
    const std::vector<int32_t> owners = *objects_of_cells(grid, objects);
    std::map<int32_t, int> houses;
    for (size_t v = 0; v < grid.cells.size(); ++v)
        if (grid.labels[v] == kBuilding || grid.labels[v] == kCar) {
            ASSERT_NE(owners[v], kNoObject);
            ++houses[owners[v]];
        }
    EXPECT_EQ(houses.size(), 6u);
}

TEST(engine_guessed_objects, a_turned_scene_has_turned_objects)
{
    const auto straight = of_class(guessed(street().grid(), usual(), 1), kBuilding);
    const auto turned = of_class(guessed(street().turned().grid(), usual(), 1), kBuilding);
    ASSERT_EQ(turned.size(), straight.size());
    for (const SceneObject& o : straight) {
        const auto same = std::ranges::find_if(turned, [&](const SceneObject& t) {
            return std::hypot(t.center[0] + o.center[1], t.center[1] - o.center[0]) < 0.7;
        });
        ASSERT_NE(same, turned.end());
        EXPECT_LT(apart(same->heading, o.heading + kPi / 2), 0.05);
    }
}

TEST(engine_guessed_objects, a_long_front_without_steps_is_cut_at_places_that_the_seed_decides)
{
    Scene s;
    s.fill(kRoad, {0, 0, 0}, {99, 9, 0});
    s.fill(kBuilding, {0, 12, 0}, {99, 12, 19});
    const VoxelGrid grid = s.grid();
    std::set<double> widths;
    for (uint64_t seed : {1, 2, 3}) {
        const auto houses = of_class(guessed(grid, usual(), seed), kBuilding);
        ASSERT_EQ(houses.size(), 5u) << "60 m of 11 m each";
        for (const SceneObject& o : houses) {
            EXPECT_GT(o.size[1], 6);
            EXPECT_LT(o.size[1], 17);
            widths.insert(o.size[1]);
        }
    }
    EXPECT_GT(widths.size(), 5u);
}

TEST(engine_guessed_objects, colours_depend_on_the_seed_and_boxes_of_cars_do_not)
{
    const VoxelGrid grid = street().grid();
    const auto first = guessed(grid, usual(), 1), again = guessed(grid, usual(), 1);
    std::set<std::array<double, 3>> tints;
    for (uint64_t seed = 1; seed < 12; ++seed) {
        const auto cars = of_class(guessed(grid, usual(), seed), kCar);
        EXPECT_EQ(cars[0].center, of_class(first, kCar)[0].center);
        tints.insert(*cars[0].tint);
    }
    EXPECT_EQ(tints.size(), 3u) << "each usual colour is drawn at times";
    for (size_t o = 0; o < first.size(); ++o) {
        EXPECT_EQ(first[o].center, again[o].center);
        EXPECT_EQ(first[o].tint, again[o].tint);
    }
}

TEST(engine_guessed_objects, classes_of_which_nothing_is_usual_have_none)
{
    const VoxelGrid grid = street().grid();
    UsualObjects only_cars = usual();
    only_cars[kBuilding] = {};
    EXPECT_EQ(guessed(grid, only_cars, 1).size(), 3u);
    EXPECT_TRUE(guessed(grid, {}, 1).empty());
}

TEST(engine_guessed_objects, a_building_without_a_street_has_a_box_around_it)
{
    Scene s;
    s.fill(kBuilding, {0, 0, 0}, {19, 9, 9});
    const auto houses = guessed(s.grid(), usual(), 1);
    ASSERT_EQ(houses.size(), 1u);
    EXPECT_NEAR(houses[0].center[0], 6, 1e-6);
    EXPECT_NEAR(houses[0].center[1], 3, 1e-6);
}

TEST(engine_guessed_objects, what_is_seen_of_a_thing_is_too_little_to_tell_of_it_below_a_quarter_of_each_size)
{
    Scene s;
    s.fill(kBuilding, {0, 0, 0}, {4, 4, 7});     // a kiosk: 2.4 m between the outer cells' centres, 4.2 m high
    s.fill(kBuilding, {20, 0, 0}, {25, 0, 0});   // 3 m long
    s.fill(kBuilding, {40, 0, 20}, {40, 0, 20}); // of a roof
    s.fill(kCar, {60, 0, 0}, {61, 0, 0});        // 0.6 m long, as thin as a box may be
    s.fill(kCar, {80, 0, 0}, {80, 1, 0});        // 0.6 m long or across
    s.fill(kCar, {90, 0, 0}, {92, 0, 0});        // 1.2 m long
    std::map<uint8_t, std::vector<double>> along;
    for (const SceneObject& o : guessed(s.grid(), usual(), 1))
        along[o.label].push_back(o.center[0]);
    EXPECT_EQ(along[kBuilding].size(), 2u);
    ASSERT_EQ(along[kCar].size(), 1u);
    EXPECT_NEAR(along[kCar][0], 91.5 * 0.6, 1e-4);
}

TEST(engine_guessed_objects, a_table_of_what_is_usual_is_read_and_mistakes_are_named)
{
    const auto read = [](const char* text) { return parse_usual_objects(*parse_json(text, "t"), "t"); };
    const auto table = read(R"({"car": {"size": [4.6, 2.1, 1.5], "tints": ["#ff0000", "#0000ff"]}})");
    ASSERT_TRUE(table) << table.error().message;
    EXPECT_EQ((*table)[kCar].size[0], 4.6);
    EXPECT_EQ((*table)[kCar].tints[1], (std::array<double, 3>{0, 0, 1}));
    EXPECT_FALSE((*table)[kBuilding].known());
    const auto house = [&](const std::string& parts) {
        return read((R"({"building": {"size": [9, 9, 9], "parts": )" + parts + "}}").c_str());
    };
    const auto windows = house(R"({"size": [1, 1.2, 1.6], "pitch": [2.6, 3.1], "low": 0, "tints": ["#ff0000"]})");
    ASSERT_TRUE(windows) << windows.error().message;
    EXPECT_EQ((*windows)[kBuilding].parts->pitch[1], 3.1);
    EXPECT_EQ((*windows)[kBuilding].parts->tints.size(), 1u);
    EXPECT_FALSE((*table)[kCar].parts);
    EXPECT_TRUE(says(house("[]"), "building: parts: expected an object"));
    EXPECT_TRUE(says(house(R"({"size": [1, 1, 1], "low": 0})"), "parts: pitch"));
    EXPECT_TRUE(says(house(R"({"size": [1, 1, 1], "pitch": [1, 1], "low": -1})"), "low: expected metres from 0"));
    EXPECT_TRUE(says(house(R"({"size": [1, 1, 1], "pitch": [1, 1], "low": 1, "high": 2})"), "high"));
    EXPECT_TRUE(says(read(R"([])"), "expected an object"));
    EXPECT_TRUE(says(read(R"({"cat": {"size": [1, 1, 1]}})"), "no class 'cat'"));
    EXPECT_TRUE(says(read(R"({"car": {"size": [1, 1]}})"), "car: size: expected 3 numbers"));
    EXPECT_TRUE(says(read(R"({"car": {}})"), "car: size"));
    EXPECT_TRUE(says(read(R"({"car": {"size": [1, 0, 1]}})"), "0.001 to 1000"));
    EXPECT_TRUE(says(read(R"({"car": {"size": [1, 1, 1], "tints": ["red"]}})"), "#rrggbb"));
    EXPECT_TRUE(says(read(R"({"car": {"size": [1, 1, 1], "tint": []}})"), "tint"));
}

} // namespace engine_guessed_objects_test
} // namespace semrover
