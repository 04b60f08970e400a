// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/cell_reach.h"
#include "runtime/base/dtype.h"
#include "runtime/base/hash.h"
#include "runtime/base/safetensors.h"
#include "tests/support/json_text.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/editing/editing.h"
#include "tools/editing/grid_editor.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

namespace semrover {
namespace engine_edit_test {

using Cells = std::vector<Cell>;
using Kind = EditOperation::Kind;

constexpr uint8_t kRoad = 0, kSidewalk = 1, kBuilding = 2, kVegetation = 8, kCar = 13;

VoxelGrid grid_of(const std::map<Cell, uint8_t>& labels, float voxel_size = 0.6f)
{
    VoxelGrid grid;
    grid.voxel_size = voxel_size;
    for (const auto& [cell, label] : labels) {
        grid.cells.push_back(cell);
        grid.labels.push_back(label);
    }
    return grid;
}

// two points a voxel that tell where they come from
void add_points(VoxelGrid& grid)
{
    grid.points_per_voxel = 2;
    for (size_t c = 0; c < grid.cells.size(); ++c)
        for (size_t v = 0; v < 6; ++v) {
            grid.points.push_back(float_to_half(float((c * 6 + v) % 97) / 400 - 0.12f));
            grid.colors.push_back(uint8_t(c * 7 + v));
        }
    grid.generated.assign(grid.cells.size(), 1);
}

std::map<Cell, uint8_t> labels_of(const VoxelGrid& grid)
{
    std::map<Cell, uint8_t> labels;
    for (size_t c = 0; c < grid.cells.size(); ++c)
        labels[grid.cells[c]] = grid.labels[c];
    return labels;
}

// a road of 8 x 6 voxels with a pavement along its last row; on it a car whose body, at k = 1, lies over the road but
// for its wheels at k = 0, where there is no road
std::map<Cell, uint8_t> street()
{
    std::map<Cell, uint8_t> labels;
    for (int32_t i = 0; i < 8; ++i)
        for (int32_t j = 0; j < 6; ++j)
            labels[{i, j, 0}] = j == 5 ? kSidewalk : kRoad;
    for (int32_t i = 2; i < 5; ++i)
        for (int32_t j = 2; j < 4; ++j)
            labels[{i, j, 1}] = kCar;
    for (const Cell& wheel : Cells{{2, 2, 0}, {4, 2, 0}, {2, 3, 0}, {4, 3, 0}})
        labels[wheel] = kCar;
    return labels;
}

EditedGrid edited(const VoxelGrid& grid, const std::vector<EditOperation>& operations)
{
    GridEditor editor(grid);
    for (const EditOperation& o : operations) {
        const Status status = editor.apply(o);
        EXPECT_TRUE(status) << status.error().message;
    }
    EditedGrid out = editor.finish();
    if (!out.grid.cells.empty()) {
        EXPECT_TRUE(check_grid(out.grid, "edited"));
    }
    return out;
}

EditOperation remove_class(uint8_t label)
{
    EditOperation o;
    o.where.label = label;
    return o;
}

WorldBox box(const Cell& low, const Cell& high) // the voxels from low to high
{
    WorldBox b;
    for (size_t a = 0; a < 3; ++a)
        b.low[a] = low[a] * 0.6, b.high[a] = (high[a] + 1) * 0.6;
    return b;
}

TEST(engine_edit, reach_is_that_of_a_brute_force_search)
{
    std::mt19937 random(5);
    for (const double metres : {0.0, 0.6, 1.0, 3.0, 7.3}) {
        const int64_t reach2 = reach_squared(metres, 0.6f);
        std::set<Cell> cells, sources;
        const auto any = [&] { return int32_t(random() % 40) - 20; };
        for (int i = 0; i < 3000; ++i)
            cells.insert({any(), any(), any() / 2});
        for (int i = 0; i < 12; ++i)
            sources.insert(i % 2 ? *std::next(cells.begin(), random() % 1000) : Cell{any(), any(), any()});
        const Cells all(cells.begin(), cells.end()), from(sources.begin(), sources.end());
        std::vector<uint32_t> expected;
        for (uint32_t c = 0; c < all.size(); ++c)
            if (std::ranges::any_of(from, [&](const Cell& s) {
                    const double d = std::hypot(all[c][0] - s[0], all[c][1] - s[1], all[c][2] - s[2]) * 0.6;
                    return d <= metres + 1e-6;
                }))
                expected.push_back(c);
        EXPECT_EQ(cells_within(all, from, reach2), expected) << metres;
    }
    EXPECT_EQ(reach_squared(3, 0.6f), 25);
}

TEST(engine_edit, a_place_in_metres_is_the_cell_that_decimals_say)
{
    for (int32_t i = -2000; i < 2000; ++i) {
        EXPECT_EQ(cell_at({i * 0.6, 0, 0}, 0.6f)[0], i);
        EXPECT_EQ(cell_at({i * 0.1 + 0.05, 0, 0}, 0.1f)[0], i);
    }
}

TEST(engine_edit, a_removed_car_leaves_road_behind)
{
    const VoxelGrid grid = grid_of(street());
    const EditedGrid out = edited(grid, {remove_class(kCar)});
    std::map<Cell, uint8_t> expected;
    for (int32_t i = 0; i < 8; ++i)
        for (int32_t j = 0; j < 6; ++j)
            expected[{i, j, 0}] = j == 5 ? kSidewalk : kRoad;
    EXPECT_EQ(labels_of(out.grid), expected);
    const Cells changed = {{2, 2, 0}, {2, 2, 1}, {2, 3, 0}, {2, 3, 1}, {3, 2, 1},
                           {3, 3, 1}, {4, 2, 0}, {4, 2, 1}, {4, 3, 0}, {4, 3, 1}};
    EXPECT_EQ(out.touched, changed);
    EXPECT_TRUE(out.kept.empty());
}

TEST(engine_edit, a_deleted_car_leaves_holes)
{
    EditOperation o = remove_class(kCar);
    o.kind = Kind::erase;
    std::map<Cell, uint8_t> expected = street();
    std::erase_if(expected, [](const auto& cell) { return cell.second == kCar; });
    EXPECT_EQ(labels_of(edited(grid_of(street()), {o}).grid), expected);
}

TEST(engine_edit, what_stood_high_above_no_ground_invents_none)
{
    std::map<Cell, uint8_t> labels = street();
    labels[{20, 2, 6}] = kVegetation; // farther than ground is looked for
    labels[{9, 2, 4}] = kVegetation;  // above the level of the ground beside it
    labels[{9, 4, 1}] = kVegetation;  // one voxel above: it stood there
    const EditedGrid out = edited(grid_of(labels), {remove_class(kVegetation)});
    std::map<Cell, uint8_t> expected = street();
    expected[{9, 4, 0}] = kRoad;
    EXPECT_EQ(labels_of(out.grid), expected);
}

TEST(engine_edit, an_object_is_its_connected_cells_of_one_label)
{
    std::map<Cell, uint8_t> labels = street();
    labels[{7, 2, 1}] = kCar; // another car
    labels[{5, 4, 2}] = kCar; // touches the first at an edge: the same object
    labels[{1, 1, 1}] = kBuilding;
    const VoxelGrid grid = grid_of(labels);
    CellSelection s;
    s.object = Cell{2, 2, 1};
    const auto cells = select_cells(grid, s);
    ASSERT_TRUE(cells);
    EXPECT_EQ(cells->size(), 11u);
    for (const uint32_t c : *cells)
        EXPECT_TRUE(grid.labels[c] == kCar && grid.cells[c] != (Cell{7, 2, 1}));
    s.box = box({2, 2, 0}, {4, 3, 0});
    EXPECT_EQ(select_cells(grid, s)->size(), 4u);
    s.object = Cell{2, 2, 7};
    EXPECT_TRUE(says(select_cells(grid, s), "no voxel (2, 2, 7)"));
}

TEST(engine_edit, boxes_and_spheres_take_cells_by_their_centres)
{
    const VoxelGrid grid = grid_of(street());
    CellSelection s;
    s.box = WorldBox{{0.3, 0.3, 0.3}, {0.9, 0.3, 0.3}}; // through the centres of two voxels
    EXPECT_EQ(*select_cells(grid, s), (std::vector<uint32_t>{0, 6}));
    s.box.reset();
    s.sphere = WorldSphere{{0.3, 0.3, 0.3}, 0.6};
    Cells found;
    const std::vector<uint32_t> in_sphere = *select_cells(grid, s);
    for (const uint32_t c : in_sphere)
        found.push_back(grid.cells[c]);
    EXPECT_EQ(found, (Cells{{0, 0, 0}, {0, 1, 0}, {1, 0, 0}}));
    EXPECT_EQ(places_in(s, 0.6f)->size(), 7u);
    s.sphere->radius = 1e5;
    EXPECT_TRUE(says(places_in(s, 0.6f), "too many"));
}

TEST(engine_edit, paint_changes_labels_and_fill_makes_cells)
{
    EditOperation o;
    o.kind = Kind::paint;
    o.label = kSidewalk;
    o.where.box = box({0, 4, 0}, {1, 5, 1});
    const EditedGrid painted = edited(grid_of(street()), {o});
    std::map<Cell, uint8_t> expected = street();
    expected[{0, 4, 0}] = expected[{1, 4, 0}] = kSidewalk; // row 5 was pavement before
    EXPECT_EQ(labels_of(painted.grid), expected);
    EXPECT_EQ(painted.touched, (Cells{{0, 4, 0}, {1, 4, 0}}));
    o.fill = true;
    for (const Cell& cell : Cells{{0, 4, 1}, {0, 5, 1}, {1, 4, 1}, {1, 5, 1}})
        expected[cell] = kSidewalk;
    EXPECT_EQ(labels_of(edited(grid_of(street()), {o}).grid), expected);
}

TEST(engine_edit, points_stay_where_labels_do)
{
    VoxelGrid grid = grid_of(street());
    add_points(grid);
    const EditedGrid out = edited(grid, {remove_class(kCar)});
    for (size_t c = 0; c < out.grid.cells.size(); ++c) {
        const size_t before = *find_cell(grid, out.grid.cells[c]);
        const bool same = grid.labels[before] == out.grid.labels[c];
        EXPECT_EQ(out.grid.generated[c], same);
        for (size_t v = 0; v < 6; ++v) {
            EXPECT_EQ(out.grid.points[c * 6 + v], same ? grid.points[before * 6 + v] : 0);
            EXPECT_EQ(out.grid.colors[c * 6 + v], same ? grid.colors[before * 6 + v] : 0);
        }
    }
}

TEST(engine_edit, painting_there_and_back_changes_nothing)
{
    VoxelGrid grid = grid_of(street());
    add_points(grid);
    EditOperation there = remove_class(kCar), back;
    there.kind = back.kind = Kind::paint;
    there.label = back.where.label.emplace(14); // truck
    back.label = kCar;
    const EditedGrid out = edited(grid, {there, back});
    EXPECT_TRUE(out.touched.empty());
    EXPECT_EQ(out.grid.points, grid.points);
    EXPECT_EQ(out.grid.generated, grid.generated);
}

TEST(engine_edit, a_stamp_turns_with_its_points_and_four_quarters_give_it_back)
{
    VoxelGrid grid = grid_of({{{3, 5, 1}, kCar}, {{4, 5, 1}, kCar}, {{4, 7, 2}, kBuilding}});
    add_points(grid);
    grid.generated[1] = 0;
    const VoxelGrid stamp = cut_stamp(grid, std::vector<uint32_t>{0, 1, 2});
    EXPECT_EQ(stamp.cells, (Cells{{0, 0, 0}, {1, 0, 0}, {1, 2, 1}}));
    EXPECT_EQ(stamp.metadata.at("stamp_origin"), "3,5,1");
    EXPECT_EQ(stamp.points, grid.points);
    const VoxelGrid quarter = turned(stamp, 1);
    EXPECT_EQ(quarter.cells, (Cells{{0, 1, 1}, {2, 0, 0}, {2, 1, 0}})); // (x, y) -> (-y, x), moved to the origin
    EXPECT_EQ(quarter.labels, (std::vector<uint8_t>{kBuilding, kCar, kCar}));
    EXPECT_EQ(quarter.generated, (std::vector<uint8_t>{1, 1, 0}));
    const std::array<size_t, 3> from = {2, 0, 1};
    for (size_t c = 0; c < 3; ++c)
        for (size_t p = 0; p < 2; ++p) {
            const uint16_t *is = &quarter.points[c * 6 + p * 3], *was = &stamp.points[from[c] * 6 + p * 3];
            EXPECT_EQ(half_to_float(is[0]), -half_to_float(was[1]));
            EXPECT_EQ(half_to_float(is[1]), half_to_float(was[0]));
            EXPECT_EQ(is[2], was[2]);
            for (size_t a = 0; a < 3; ++a)
                EXPECT_EQ(quarter.colors[c * 6 + p * 3 + a], stamp.colors[from[c] * 6 + p * 3 + a]);
        }
    const VoxelGrid whole = turned(turned(turned(quarter, 1), 1), 1);
    EXPECT_EQ(whole.cells, stamp.cells);
    EXPECT_EQ(whole.points, stamp.points);
    EXPECT_EQ(whole.colors, stamp.colors);
    EXPECT_EQ(turned(stamp, 3).points, turned(turned(quarter, 1), 1).points);
}

TEST(engine_edit, an_inserted_stamp_replaces_cells_and_may_keep_its_points)
{
    const ScratchFolder folder;
    VoxelGrid car = grid_of({{{0, 0, 0}, kCar}, {{1, 0, 1}, kCar}});
    add_points(car);
    ASSERT_TRUE(write_grid(folder / "car.sgrid", car));
    VoxelGrid grid = grid_of(street());
    add_points(grid);
    EditOperation o;
    o.kind = Kind::insert;
    o.stamp = folder / "car.sgrid";
    o.at = {0.6 * 5 + 0.3, 0.6 * 4 + 0.1, 0.2};
    EditedGrid out = edited(grid, {o});
    std::map<Cell, uint8_t> expected = street();
    expected[{5, 4, 0}] = expected[{6, 4, 1}] = kCar;
    EXPECT_EQ(labels_of(out.grid), expected);
    EXPECT_EQ(out.touched, (Cells{{5, 4, 0}, {6, 4, 1}}));
    EXPECT_TRUE(out.kept.empty());
    EXPECT_EQ(std::ranges::count(out.grid.generated, 0), 2);
    o.keep_points = true;
    o.quarter_turns = 2;
    out = edited(grid, {o});
    EXPECT_EQ(out.kept, (Cells{{5, 4, 1}, {6, 4, 0}}));
    const size_t at = *find_cell(out.grid, {6, 4, 0});
    EXPECT_EQ(out.grid.generated[at], 1);
    EXPECT_EQ(half_to_float(out.grid.points[at * 6]), -half_to_float(car.points[0]));
    EXPECT_EQ(out.grid.colors[at * 6 + 5], car.colors[5]);
    EXPECT_EQ(std::ranges::count(out.grid.generated, 0), 0);
}

TEST(engine_edit, stamps_that_do_not_fit_are_refused)
{
    const ScratchFolder folder;
    const VoxelGrid grid = grid_of(street());
    VoxelGrid plain = grid_of({{{0, 0, 0}, kCar}}), coarse = grid_of({{{0, 0, 0}, kCar}}, 1.2f);
    ASSERT_TRUE(write_grid(folder / "plain.sgrid", plain));
    ASSERT_TRUE(write_grid(folder / "coarse.sgrid", coarse));
    EditOperation o;
    o.kind = Kind::insert;
    o.at = {0, 0, 0};
    o.stamp = folder / "none.sgrid";
    EXPECT_TRUE(says(GridEditor(grid).apply(o), "none.sgrid"));
    o.stamp = folder / "coarse.sgrid";
    EXPECT_TRUE(says(GridEditor(grid).apply(o), "voxels of 1.2 m"));
    o.stamp = folder / "plain.sgrid";
    o.keep_points = true;
    EXPECT_TRUE(says(GridEditor(grid).apply(o), "points to keep"));
    add_points(plain);
    ASSERT_TRUE(write_grid(folder / "plain.sgrid", plain));
    VoxelGrid three = grid;
    three.points_per_voxel = 20; // what the grid will have
    EXPECT_TRUE(says(GridEditor(three).apply(o), "2 points a voxel, the grid 20"));
    EXPECT_TRUE(
        says(GridEditor(grid).apply(remove_class(kBuilding)), "no voxel of the grid is selected (class building)"));
}

TEST(engine_edit, a_moved_car_leaves_road_and_stands_elsewhere_with_its_points)
{
    VoxelGrid grid = grid_of(street());
    add_points(grid);
    EditOperation o = remove_class(kCar);
    o.kind = Kind::move;
    o.by = {0.6 * 3 + 0.1, -0.6, 0}; // rounded to (3, -1, 0)
    o.keep_points = true;
    const EditedGrid out = edited(grid, {o});
    std::map<Cell, uint8_t> expected;
    for (int32_t i = 0; i < 8; ++i)
        for (int32_t j = 0; j < 6; ++j)
            expected[{i, j, 0}] = j == 5 ? kSidewalk : kRoad;
    Cells there;
    for (const auto& [cell, label] : street())
        if (label == kCar) {
            there.push_back({cell[0] + 3, cell[1] - 1, cell[2]});
            expected[there.back()] = kCar;
            const size_t a = *find_cell(grid, cell), b = *find_cell(out.grid, there.back());
            EXPECT_TRUE(std::equal(&grid.points[a * 6], &grid.points[a * 6] + 6, &out.grid.points[b * 6]));
        }
    EXPECT_EQ(labels_of(out.grid), expected);
    EXPECT_EQ(out.kept, there);
    o.kind = Kind::copy;
    for (const auto& [cell, label] : street())
        if (label == kCar)
            expected[cell] = kCar;
    EXPECT_EQ(labels_of(edited(grid, {o}).grid), expected);
}

// ---- scripts

TEST(engine_edit, a_script_says_what_the_command_line_says)
{
    const ScratchFolder folder;
    const Path file = folder.put("edits.json", R"([
        {"op": "remove", "class": "car", "box": [0, 0, 0, 9, 9, 9]},
        {"op": "delete", "object": [1, 2, 3]},
        {"op": "paint", "label": "road", "sphere": [0, 0, 0, 2.5], "fill": true},
        {"op": "insert", "stamp": "car.sgrid", "at": [1, 2, 3], "rotate": 270, "points": "keep"},
        {"op": "move", "class": "13", "by": [0, 0.6, 0]}])");
    const auto o = read_edit_script(file);
    ASSERT_TRUE(o) << o.error().message;
    ASSERT_EQ(o->size(), 5u);
    EXPECT_EQ((*o)[0].where.label, kCar);
    EXPECT_EQ((*o)[0].where.box->high[2], 9);
    EXPECT_EQ((*o)[1].where.object, (Cell{1, 2, 3}));
    EXPECT_TRUE((*o)[2].fill && (*o)[2].where.sphere->radius == 2.5);
    EXPECT_EQ((*o)[3].stamp, folder / "car.sgrid");
    EXPECT_TRUE((*o)[3].quarter_turns == 3 && (*o)[3].keep_points);
    EXPECT_EQ((*o)[4].kind, Kind::move);
    Json again = Json::array();
    for (const EditOperation& operation : *o)
        again.push_back(operation_json(operation));
    const auto reread = parse_edit_script(again, folder.path(), "again");
    ASSERT_TRUE(reread) << reread.error().message;
    for (size_t i = 0; i < o->size(); ++i)
        EXPECT_EQ(operation_json((*reread)[i]), again[i]);
}

TEST(engine_edit, scripts_that_make_no_sense_are_refused_with_their_place)
{
    const std::pair<const char*, const char*> cases[] = {
        {R"({})", "expected an array of operations"},
        {R"([])", "an empty one"},
        {R"([7])", "operation 1: expected an object, found number"},
        {R"([{"op": "burn"}])", "found 'burn'"},
        {R"([{"op": "remove"}])", "operation 1: say which voxels"},
        {R"([{"op": "remove", "class": "cat"}])", "unknown class 'cat'"},
        {R"([{"op": "remove", "class": "car"}, {"op": "remove", "klass": "car"}])", "operation 2: unknown key 'klass'"},
        {R"([{"op": "remove", "box": [0, 0, 0, 1, 1]}])", "expected 6 numbers, found 5"},
        {R"([{"op": "remove", "box": [0, 0, 5, 1, 1, 1]}])", "ends before it begins"},
        {R"([{"op": "remove", "box": "everything"}])", "expected an array of numbers"},
        {R"([{"op": "remove", "sphere": [0, 0, 0, -1]}])", "radius above 0"},
        {R"([{"op": "remove", "sphere": [0, 0, 1e300, 1]}])", "absurd"},
        {R"([{"op": "remove", "object": [0.5, 0, 0]}])", "index of a voxel"},
        {R"([{"op": "paint", "class": "car"}])", "has a label"},
        {R"([{"op": "paint", "label": "road", "class": "car", "fill": true}])", "what is filled is a box"},
        {R"([{"op": "paint", "label": "road", "class": "car", "fill": 1}])", "fill: expected true or false"},
        {R"([{"op": "insert", "stamp": "x"}])", "`at` is missing"},
        {R"([{"op": "insert", "at": [0, 0, 0]}])", "the stamp is missing"},
        {R"([{"op": "insert", "stamp": "/etc/passwd", "at": [0, 0, 0]}])", "operation 1: stamp: expected a file in"},
        {R"([{"op": "insert", "stamp": "a/../../x", "at": [0, 0, 0]}])", "found 'a/../../x'"},
        {R"([{"op": "insert", "stamp": "a\u0000b", "at": [0, 0, 0]}])", "operation 1: stamp: expected a file in"},
        {R"([{"op": "insert", "stamp": "x", "at": [0, 0, 0], "rotate": 45}])", "0, 90, 180 or 270"},
        {R"([{"op": "copy", "class": "car"}])", "`by` is missing"},
        {R"([{"op": "copy", "class": "car", "by": [1, 1, 1], "points": "maybe"}])", "keep or regenerate"},
        {R"([{"op": "remove", "class": "car", "op": "paint"}])", "op"},
    };
    const ScratchFolder folder;
    for (const auto& [text, message] : cases)
        EXPECT_TRUE(says(read_edit_script(folder.put("x.json", text)), message)) << text;
}

TEST(engine_edit, a_link_does_not_lead_out_of_a_script_s_folder)
{
    const ScratchFolder folder;
    const auto script = [&](const std::string& stamp) {
        return read_edit_script(
            folder.put("in/x.json", fmt::format(R"([{{"op": "insert", "stamp": "{}", "at": [0, 0, 0]}}])", stamp)));
    };
    ASSERT_TRUE(write_grid(folder / "car.sgrid", grid_of(street())));
    ASSERT_TRUE(make_folder(folder / "in/stamps"));
    ASSERT_TRUE(write_grid(folder / "in/stamps/car.sgrid", grid_of(street())));
    std::filesystem::create_symlink("..", folder / "in/up");
    std::filesystem::create_symlink("../car.sgrid", folder / "in/out.sgrid");
    std::filesystem::create_symlink("stamps/car.sgrid", folder / "in/stays.sgrid");
    EXPECT_TRUE(script("stays.sgrid"));
    EXPECT_TRUE(script((folder / "in/stamps/car.sgrid").string()));
    for (const char* stamp : {"up/car.sgrid", "out.sgrid"})
        EXPECT_TRUE(says(script(stamp), "expected a file in the script's folder")) << stamp;
}

TEST(engine_edit, copies_of_copies_end_early)
{
    for (const bool keep : {false, true}) {
        VoxelGrid grid = grid_of(street());
        add_points(grid);
        GridEditor editor(grid);
        Status status;
        int copies = 0;
        for (; status && copies < 30; ++copies) {
            EditOperation o;
            o.kind = Kind::copy;
            o.by = {8 * 0.6 * (1 << copies), 0.0, 0.0};
            o.where.box = box({0, 0, 0}, {8 * (1 << copies) - 1, 5, 1});
            o.keep_points = keep;
            status = editor.apply(o);
        }
        EXPECT_TRUE(says(status, keep ? "copy: an edit of a grid of 54 voxels may make it one of at most 1048792"
                                      : "at most 4194520"));
        EXPECT_EQ(copies, keep ? 15 : 17); // 54 voxels at the first
    }
}

// ---- undo

class EngineUndo : public testing::Test {
  protected:
    // edits, writes both and the record, takes it back; true when the bytes are those of before
    bool comes_back(const Path& before_path, const std::vector<EditOperation>& operations, bool generate)
    {
        const auto before = read_grid(before_path);
        EXPECT_TRUE(before) << before.error().message;
        EditedGrid out = edited(*before, operations);
        if (generate && out.grid.has_points())
            for (size_t c = 0; c < out.grid.cells.size(); ++c)
                if (!out.grid.generated[c]) {
                    out.grid.generated[c] = 1;
                    out.grid.points[c * 6] = float_to_half(0.25f);
                }
        out.grid.metadata["tool"] = "another";
        EXPECT_TRUE(write_grid(folder_ / "after.sgrid", out.grid));
        EXPECT_TRUE(write_undo(folder_ / "undo", before_path, *before, folder_ / "after.sgrid", out.grid));
        const Status status = undo_edit(folder_ / "undo", folder_ / "after.sgrid", folder_ / "back.sgrid");
        EXPECT_TRUE(status) << status.error().message;
        return contents(folder_ / "back.sgrid") == contents(before_path);
    }
    Path grid_file(bool points)
    {
        VoxelGrid grid = grid_of(street());
        if (points)
            add_points(grid);
        grid.points_per_voxel = points ? 2 : 20;
        grid.metadata["name"] = "a \"street\"";
        EXPECT_TRUE(write_grid(folder_ / "before.sgrid", grid));
        return folder_ / "before.sgrid";
    }

    ScratchFolder folder_;
};

TEST_F(EngineUndo, any_edit_is_taken_back_to_the_byte)
{
    EditOperation paint, fill, insert, move = remove_class(kCar);
    paint.kind = fill.kind = Kind::paint;
    paint.where.label = kSidewalk;
    fill.where.box = box({0, 0, 3}, {1, 1, 4});
    fill.fill = true;
    move.kind = Kind::move;
    move.by = {0.6, 0, 1.2};
    VoxelGrid stamp = grid_of({{{0, 0, 0}, kBuilding}, {{1, 0, 0}, kBuilding}});
    add_points(stamp);
    ASSERT_TRUE(write_grid(folder_ / "stamp.sgrid", stamp));
    insert.kind = Kind::insert;
    insert.stamp = folder_ / "stamp.sgrid";
    insert.at = {0, 0, 0};
    for (const bool points : {false, true}) {
        const Path before = grid_file(points);
        insert.keep_points = points;
        for (const auto& operations : std::vector<std::vector<EditOperation>>{
                 {remove_class(kCar)}, {paint}, {fill}, {move}, {insert}, {move, paint, fill, insert}})
            for (const bool generate : {false, true})
                EXPECT_TRUE(comes_back(before, operations, generate));
    }
}

TEST_F(EngineUndo, a_file_that_another_program_wrote_comes_back_as_it_was)
{
    // voxels in another order, and a key that our reader passes over as metadata
    const std::vector<int32_t> cells = {5, 0, 0, 4, 0, 0, 4, 0, 1};
    const std::vector<uint8_t> labels = {0, 0, 13};
    const TensorData tensors[] = {{"cells", DType::i32, {3, 3}, std::as_bytes(std::span(cells))},
                                  {"labels", DType::u8, {3}, std::as_bytes(std::span(labels))}};
    ASSERT_TRUE(write_safetensors(folder_ / "other.sgrid", tensors, {{"voxel_size", "0.60"}}));
    EXPECT_TRUE(comes_back(folder_ / "other.sgrid", {remove_class(kCar)}, false));
}

TEST_F(EngineUndo, records_that_are_damaged_or_of_another_grid_change_nothing)
{
    const Path before = grid_file(true);
    ASSERT_TRUE(comes_back(before, {remove_class(kCar)}, true));
    const auto refused = [&](const Path& record, const Path& grid, const char* text) {
        const size_t entries = folder_.entries();
        EXPECT_TRUE(says(undo_edit(record, grid, folder_ / "none.sgrid"), text));
        EXPECT_EQ(folder_.entries(), entries);
    };
    refused(folder_ / "undo", before, "is not the grid that");
    refused(folder_ / "undo", folder_ / "missing", "missing");
    refused(folder_ / "missing", before, "missing");
    refused(before, before, "not an undo record");
    const auto file = Safetensors::open(folder_ / "undo");
    ASSERT_TRUE(file);
    using Change = std::function<void(std::vector<TensorData>&, std::map<std::string, std::string>&)>;
    const auto changed = [&](const Change& change) {
        std::vector<TensorData> tensors;
        for (const TensorInfo& t : file->tensors())
            tensors.push_back({t.name, t.dtype, t.shape, file->bytes(t)});
        auto metadata = file->metadata();
        change(tensors, metadata);
        EXPECT_TRUE(write_safetensors(folder_ / "bad", tensors, metadata));
        return folder_ / "bad";
    };
    const Path after = folder_ / "after.sgrid";
    changed([](auto&, auto&) {});
    const auto drop = [](const char* name) {
        return [name](auto& tensors, auto&) { std::erase_if(tensors, [&](const auto& t) { return t.name == name; }); };
    };
    refused(changed(drop("labels")), after, "labels");
    refused(changed(drop("points")), after, "points");
    refused(changed([](auto&, auto& m) { m["version"] = "2"; }), after, "not an undo record of this version");
    refused(changed([](auto&, auto& m) { m["points_per_voxel"] = "-1"; }), after, "points_per_voxel");
    refused(changed([](auto&, auto& m) { m["voxel_size"] = "wide"; }), after, "'wide'");
    refused(changed([](auto&, auto& m) { m["metadata"] = "[1]"; }), after, "object of strings");
    refused(changed([](auto&, auto& m) { m["metadata"] = "{"; }), after, "bad");
    refused(changed([](auto&, auto& m) { m["points"] = "no"; }), after, "points of a grid without points");
    refused(changed([](auto&, auto& m) { m["after"] = "0"; }), after, "expected '0'");
    refused(changed([](auto&, auto& m) { m["before"] = "0"; }), after, "does not give the grid back");
    std::vector<std::byte> cells;
    refused(changed([&](auto& tensors, auto&) {
                for (auto& t : tensors)
                    if (t.name == "cells") {
                        cells.assign(t.bytes.begin(), t.bytes.end());
                        std::swap_ranges(cells.begin(), cells.begin() + 12, cells.begin() + 12);
                        t.bytes = cells;
                    }
            }),
            after, "not sorted");
}

} // namespace engine_edit_test
} // namespace semrover
