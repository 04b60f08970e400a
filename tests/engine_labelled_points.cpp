// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/labelled_points.h"

#include "engine/format/ply_reader.h"
#include "engine/scene/palette.h"
#include "runtime/base/dtype.h"
#include "runtime/base/memory_files.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/dataset/object_boxes.h"
#include "tools/dataset/scene_file.h"

#include <cmath>
#include <set>

namespace semrover {
namespace engine_labelled_points_test {

std::string ply(const std::string& properties, const std::vector<std::string>& rows)
{
    std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n{}end_header\n", rows.size(), properties);
    for (const std::string& row : rows)
        text += row + "\n";
    return text;
}

constexpr const char* kXyz = "property float x\nproperty float y\nproperty float z\n";

TEST(LabelledPoints, a_cells_label_is_that_of_most_points)
{
    const ScratchFolder folder;
    const auto path = folder.put("p.ply", ply(std::string(kXyz) + "property int label\n",
                                              {"0.1 0.1 0.1 8", "0.5 0.5 0.5 8", "0.3 0.3 0.3 0", // vegetation
                                               "-0.1 0.1 0.1 5", "-0.5 0.1 0.1 3",                // a tie
                                               "0.61 -0.01 1.25 19", "nan 0 0 1", "0 inf 0 1"}));
    const auto out = read_labelled_points(path, {});
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{-1, 0, 0}, {0, 0, 0}, {1, -1, 2}}));
    EXPECT_EQ(out->grid.labels, (std::vector<uint8_t>{3, 8, 19}));
    EXPECT_FALSE(out->grid.has_points());
    ASSERT_EQ(out->warnings.size(), 2u); // nothing says that the numbers are ours
    EXPECT_TRUE(out->warnings[0].ends_with(
        ": 'label': the numbers are taken for our own classes: 0 road (1 points), 3 wall (1 points), 5 pole (1 "
        "points), "
        "8 vegetation (2 points), 19 road-lane (1 points); `map` says what they are if they are another program's"));
    EXPECT_EQ(out->warnings[1], "2 points that are not finite are left out");
    EXPECT_EQ(out->dropped, 2u);
    SceneGridOptions o;
    o.voxel_size = 0.25f;
    o.origin = {10, 0, 0};
    const auto finer = read_labelled_points(path, o);
    ASSERT_TRUE(finer) << finer.error().message;
    EXPECT_EQ(finer->grid.cells[0], (Cell{38, 0, 0})); // 9.5
}

TEST(LabelledPoints, a_file_may_be_in_memory)
{
    const std::string text = ply(std::string(kXyz) + "property int label\n", {"0.1 0.1 0.1 8"});
    MemoryFolder folder;
    ASSERT_TRUE(folder.add("p.ply", std::as_bytes(std::span(text))));
    const auto out = read_labelled_points(folder.path() / "p.ply", {});
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.labels, std::vector<uint8_t>{8});
}

TEST(LabelledPoints, any_order_of_properties_any_of_the_names_and_both_byte_orders)
{
    const ScratchFolder folder;
    for (const char* name : {"label", "class", "semantic", "classification", "scalar_label"})
        for (const bool big : {false, true}) {
            std::string bytes = fmt::format(
                "ply\nformat binary_{}_endian 1.0\nelement face 0\nproperty list uchar int i\n"
                "element vertex 1\nproperty uchar blue\nproperty double z\n"
                "property {} {}\nproperty uchar red\nproperty float x\nproperty uchar green\n"
                "property short y\nend_header\n",
                big ? "big" : "little", std::string_view(name).starts_with("scalar") ? "float" : "ushort", name);
            const auto put = [&](auto value) {
                std::string raw(reinterpret_cast<const char*>(&value), sizeof(value));
                if (big)
                    std::reverse(raw.begin(), raw.end());
                bytes += raw;
            };
            put(uint8_t(3));
            put(-1.25);
            if (std::string_view(name).starts_with("scalar"))
                put(13.f);
            else
                put(uint16_t(13));
            put(uint8_t(1));
            put(0.75f);
            put(uint8_t(2));
            put(int16_t(-2));
            SceneGridOptions o;
            o.map = "ours"; // semantic and classification are other programs' names
            o.points_per_voxel = 1;
            const auto out = read_labelled_points(folder.put("b.ply", bytes), o);
            ASSERT_TRUE(out) << out.error().message;
            EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{1, -4, -3}}));
            EXPECT_EQ(out->grid.labels, std::vector<uint8_t>{13});
            EXPECT_EQ(out->grid.colors, (std::vector<uint8_t>{1, 2, 3}));
            EXPECT_NEAR(half_to_float(out->grid.points[1]), -2 - (-3.5 * 0.6), 1e-3);
        }
}

TEST(LabelledPoints, n_points_of_a_cell_are_drawn_and_too_few_repeated)
{
    const ScratchFolder folder;
    std::vector<std::string> rows;
    for (int i = 0; i < 100; ++i) // 60 of road, 40 of sidewalk; the colour is the point's number
        rows.push_back(fmt::format("{} 0.3 0.3 {} {} 0 0", 0.005 * i + 0.01, i < 60 ? 0 : 1, i));
    rows.push_back("1.0 0.3 0.3 2 201 0 0");
    rows.push_back("1.1 0.3 0.3 2 202 0 0");
    const std::string properties =
        std::string(kXyz) + "property uchar label\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
    const auto path = folder.put("p.ply", ply(properties, rows));
    SceneGridOptions o;
    o.points_per_voxel = 5;
    const auto numbers = [&](size_t cell) { // of the points that were drawn, by their red
        const auto out = read_labelled_points(path, o);
        EXPECT_TRUE(out) << out.error().message;
        std::vector<int> n;
        for (size_t i = 0; i < size_t(o.points_per_voxel); ++i)
            n.push_back(out->grid.colors[(cell * size_t(o.points_per_voxel) + i) * 3]);
        return n;
    };
    EXPECT_EQ(numbers(1), (std::vector<int>{201, 202, 201, 202, 201}));
    const std::vector<int> first = numbers(0);
    EXPECT_TRUE(std::is_sorted(first.begin(), first.end())); // the file's order
    EXPECT_LT(first.back(), 60);                             // of the voxel's label
    EXPECT_EQ(std::set<int>(first.begin(), first.end()).size(), 5u);
    EXPECT_EQ(numbers(0), first); // the same on every run
    // every point of the label is drawn about as often
    std::vector<int> counts(100);
    for (o.seed = 0; o.seed < 240; ++o.seed)
        for (const int n : numbers(0))
            ++counts[size_t(n)];
    for (int i = 0; i < 60; ++i) // binomial, mean 20, deviation 4.3: five deviations
        EXPECT_NEAR(counts[size_t(i)], 20, 22) << i;
    EXPECT_EQ(std::count(counts.begin(), counts.begin() + 60, 0), 0);
    EXPECT_EQ(std::count(counts.begin() + 60, counts.end(), 0), 40);
    o.points_per_voxel = 80; // all of the label, and 20 others
    const std::vector<int> all = numbers(0);
    EXPECT_EQ(all[59], 59);
    EXPECT_GE(all[60], 60);
    o.labels_only = true;
    EXPECT_FALSE(read_labelled_points(path, o)->grid.has_points());
}

TEST(LabelledPoints, a_grid_comes_back_the_same)
{
    const ScratchFolder folder;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 4;
    for (int32_t i = -3; i < 40; ++i) {
        grid.cells.push_back({i, 7 * i, -i});
        grid.labels.push_back(static_cast<uint8_t>((i + 3) % 20));
        for (int k = 0; k < 12; ++k) {
            // also on the faces, as 16 bits have them: 0.30005
            const float offset = k % 4 == 0 ? 0.3f : k % 4 == 1 ? -0.3f : 0.01f * static_cast<float>(k + i % 7);
            grid.points.push_back(float_to_half(offset));
            grid.colors.push_back(static_cast<uint8_t>(i * 5 + k));
        }
        grid.generated.push_back(1);
    }
    ASSERT_TRUE(write_labelled_points(folder / "p.ply", grid));
    SceneGridOptions o;
    o.points_per_voxel = 4;
    const auto out = read_labelled_points(folder / "p.ply", o);
    ASSERT_TRUE(out) << out.error().message;
    sort_cells(grid);
    EXPECT_EQ(out->grid.cells, grid.cells);
    EXPECT_EQ(out->grid.labels, grid.labels);
    EXPECT_EQ(out->grid.colors, grid.colors);
    for (size_t i = 0; i < grid.points.size(); ++i) // positions of 150 m as floats: 8e-6 m
        EXPECT_NEAR(half_to_float(out->grid.points[i]), half_to_float(grid.points[i]), 3e-4) << i;
    // without points: centres in the labels' colours
    grid.points.clear();
    grid.colors.clear();
    grid.generated.clear();
    ASSERT_TRUE(write_labelled_points(folder / "s.ply", grid));
    o.labels_only = true;
    const auto semantic = read_labelled_points(folder / "s.ply", o);
    ASSERT_TRUE(semantic) << semantic.error().message;
    EXPECT_TRUE(semantic->warnings.empty()); // the file says whose the labels are
    EXPECT_EQ(semantic->grid.cells, grid.cells);
    EXPECT_EQ(semantic->grid.labels, grid.labels);
    const auto file = read_ply(folder / "s.ply");
    EXPECT_EQ(file->find("vertex")->find("red")->values[0], kPalette[grid.labels[0]].color[0]);
}

TEST(LabelledPoints, refuses_what_is_no_labelled_cloud)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& text, const SceneGridOptions& o = {}) {
        return read_labelled_points(folder.put("m.ply", text), o);
    };
    const std::string labelled = std::string(kXyz) + "property int label\n";
    EXPECT_TRUE(says(read_labelled_points(folder / "none.ply", {}), "none.ply"));
    EXPECT_TRUE(says(read("text"), "expected 'ply'"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\nelement face 0\nproperty int i\nend_header\n"), "no element vertex"));
    EXPECT_TRUE(says(read(ply("property float x\nproperty float y\n", {"1 2"})), "its vertices have no property z"));
    EXPECT_TRUE(says(read(ply("property list uchar float x\nproperty float y\nproperty float z\n", {"1 2 3 4"})),
                     "its vertices have no property x"));
    EXPECT_TRUE(says(read(ply(kXyz, {"1 2 3"})), "its vertices have no label; `default_label` gives"));
    EXPECT_TRUE(says(read(ply(labelled, {})), "there are no points"));
    EXPECT_TRUE(says(read(ply(labelled, {"nan 0 0 1"})), "there are no points"));
    EXPECT_TRUE(says(read(ply(labelled, {"0 0 0 25", "0 0 0 25", "0 0 0 77"})),
                     "unknown labels: 25 (2 points), 77 (1 points); `map` says"));
    EXPECT_TRUE(says(read(ply(labelled, {"0 0 0 -1"})), "vertex 0: 'label': expected a whole number, found -1"));
    EXPECT_TRUE(says(read(ply(std::string(kXyz) + "property float label\n", {"0 0 0 1.5"})), "found 1.5"));
    EXPECT_TRUE(says(read(ply(labelled, {"0 0 0 1", "1e9 0 0 1"})), "vertex 1: (1000000000, 0, 0) m is absurd"));
    EXPECT_TRUE(says(read(ply(labelled, {"0.25 0.25 0.25"})), "the row ends before 'label'"));
    SceneGridOptions o;
    o.map = folder.put("map.json", R"({"25": "car", "77": null, "road": "sidewalk"})");
    const auto mapped = read(ply(labelled, {"0 0 0 25", "0 0 0 77", "1 0 0 0"}), o);
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(mapped->grid.labels, (std::vector<uint8_t>{13, 1}));
    EXPECT_EQ(mapped->dropped, 1u);
    o = {};
    o.default_label = 8;
    EXPECT_EQ(read(ply(kXyz, {"1 2 3"}), o)->grid.labels, std::vector<uint8_t>{8});
}

TEST(LabelledPoints, carlas_tags_have_a_map)
{
    const ScratchFolder folder;
    std::vector<std::string> rows;
    for (int tag = 1; tag <= 19; ++tag)
        rows.push_back(fmt::format("{} 0 0 {}", tag, tag));
    rows.push_back("20 0 0 24");
    rows.push_back("21 0 0 0");
    SceneGridOptions o;
    o.map = SEMROVER_SOURCE_DIR "/assets/label_maps/carla.json";
    o.voxel_size = 1;
    const auto out =
        read_labelled_points(folder.put("c.ply", ply(std::string(kXyz) + "property uint ObjTag\n", rows)), o);
    ASSERT_TRUE(out) << out.error().message;
    ASSERT_EQ(out->grid.labels.size(), 20u);
    for (uint8_t i = 0; i < 20; ++i)
        EXPECT_EQ(out->grid.labels[i], i);
    EXPECT_EQ(out->dropped, 1u);
}

// a parked car on the right of the way, a wall on the left, in CARLA's axes; the car's box is found in the same place
TEST(LabelledPoints, carlas_axes_are_left_handed)
{
    const ScratchFolder folder;
    const auto cloud = folder.put(
        "lidar.ply", ply(std::string(kXyz) + "property float CosAngle\nproperty uint ObjIdx\nproperty uint ObjTag\n",
                         {"5.2 3.1 0.5 0.9 31 14", "0.1 -4.1 1.3 0.9 0 4", "3.1 0.1 -0.2 0.9 0 1"}));
    SceneGridOptions o;
    o.map = SEMROVER_SOURCE_DIR "/assets/label_maps/carla.json";
    EXPECT_EQ(detect_scene_format(cloud).value(), SceneFormat::carla_points);
    const auto out = read_scene_grid(cloud, o);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{0, 6, 2}, {5, -1, -1}, {8, -6, 0}}));
    EXPECT_EQ(out->grid.labels, (std::vector<uint8_t>{3, 0, 13})); // wall, road, car
    ASSERT_EQ(out->warnings.size(), 1u);
    EXPECT_NE(out->warnings[0].find("`format` points-ply keeps it"), std::string::npos);

    const auto boxes = read_box_file(
        folder.put("boxes.json", R"([{"type_id": "vehicle.audi.tt", "location": {"x": 5.2, "y": 3.1, "z": 0.5},
            "extent": {"x": 2, "y": 1, "z": 0.7}, "rotation": {"pitch": 0, "yaw": 0, "roll": 0}}])"),
        BoxFormat::carla, {});
    ASSERT_TRUE(boxes) << boxes.error().message;
    EXPECT_NEAR(boxes->objects[0].center[1], -3.1, 1e-6);

    o.origin = {0, 1.2, 0}; // metres of ours
    EXPECT_EQ(read_scene_grid(cloud, o)->grid.cells[0], (Cell{0, 8, 2}));
    const auto kept = read_scene_grid(cloud, o, SceneFormat::points_ply);
    EXPECT_EQ(kept->grid.cells[0], (Cell{0, -5, 2}));
    EXPECT_TRUE(kept->warnings.empty());
}

TEST(LabelledPoints, a_column_of_another_program_is_read_by_its_table)
{
    const ScratchFolder folder;
    const auto cloud = [&](const char* column) {
        return folder.put("c.ply", ply(fmt::format("{}property float {}\n", kXyz, column),
                                       {"0 0 0 2", "1 0 0 6", "2 0 0 5", "3 0 0 11"}));
    };
    using Labels = std::vector<uint8_t>;
    for (const auto& [column, table, labels] : {std::tuple{"classification", "asprs", Labels{9, 2, 8, 0}},
                                                {"scalar_Classification", "asprs", {9, 2, 8, 0}},
                                                {"semantic", "kitti360", {9, 2}},
                                                {"ObjTag", "carla", {1, 5, 4, 10}}}) {
        const auto refused = read_labelled_points(cloud(column), {});
        EXPECT_TRUE(
            says(refused, fmt::format("'{}': a column of that name holds numbers of {}, not ours: 2 ", column, table)));
        EXPECT_TRUE(says(refused, "(1 points")) << column;
        SceneGridOptions o;
        o.map = table;
        const auto read = read_labelled_points(cloud(column), o);
        ASSERT_TRUE(read) << read.error().message;
        EXPECT_EQ(read->grid.labels, labels) << column;
        o.map = "ours";
        EXPECT_EQ(read_labelled_points(cloud(column), o)->grid.labels, (Labels{2, 6, 5, 11})) << column;
    }
}

TEST(LabelledPoints, a_second_column_of_labels_is_said)
{
    const ScratchFolder folder;
    SceneGridOptions o;
    o.map = "ours";
    const auto out = read_labelled_points(
        folder.put("p.ply",
                   ply(std::string(kXyz) + "property int classification\nproperty int label\n", {"0 0 0 6 2"})),
        o);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.labels, std::vector<uint8_t>{2});
    ASSERT_EQ(out->warnings.size(), 1u);
    EXPECT_TRUE(out->warnings[0].ends_with("'label' has the labels, 'classification' is not read"));
}

// as bytes, as LAS and PDAL have them (257 times that, or the byte itself), and as floats of both kinds
TEST(LabelledPoints, colours_are_counted_as_their_type_and_size_say)
{
    const ScratchFolder folder;
    const auto read = [&](const char* type, const std::vector<std::string>& rows) {
        std::string properties = std::string(kXyz) + "property uchar label\n";
        for (const char* channel : {"red", "green", "blue"})
            properties += fmt::format("property {} {}\n", type, channel);
        SceneGridOptions o;
        o.map = "ours";
        o.points_per_voxel = 1;
        return read_labelled_points(folder.put("p.ply", ply(properties, rows)), o);
    };
    using Bytes = std::vector<uint8_t>;
    for (const auto& [type, color, warning] : {std::tuple{"uchar", "128 64 32", ""},
                                               {"ushort", "32896 16448 8224", ""},
                                               {"ushort", "128 64 32", "at most 128: they are taken for 0 to 255"},
                                               {"int", "128 64 32", ""},
                                               {"float", "128 64 32", ""},
                                               {"double", "0.501961 0.25098 0.12549", ""}}) {
        const auto out = read(type, {fmt::format("0 0 0 2 {}", color)});
        ASSERT_TRUE(out) << out.error().message;
        EXPECT_EQ(out->grid.colors, (Bytes{128, 64, 32})) << type << ' ' << color;
        EXPECT_EQ(out->warnings.size(), *warning ? 1u : 0u) << type;
        if (*warning) {
            EXPECT_NE(out->warnings[0].find(warning), std::string::npos) << out->warnings[0];
        }
    }
    // one number decides for all: a dark point of floats to 255
    EXPECT_EQ(read("float", {"0 0 0 2 0.5 0 1", "1 0 0 2 200 0 0"})->grid.colors, (Bytes{1, 0, 1, 200, 0, 0}));
    EXPECT_EQ(read("float", {"0 0 0 2 1.0004 0 -0.0004"})->grid.colors, (Bytes{255, 0, 0}));
    EXPECT_TRUE(says(read("float", {"0 0 0 2 300 0 0"}), "the colour 300, expected 0 to 1, or 0 to 255"));
    EXPECT_TRUE(says(read("float", {"0 0 0 2 0 -1 0"}), "the colour -1, expected 0 or more"));
    EXPECT_TRUE(says(read("float", {"0 0 0 2 0 nan 0"}), "row 0 has a colour that is not finite"));
    EXPECT_TRUE(says(read("uint", {"0 0 0 2 70000 0 0"}), "the colour 70000, expected 0 to 255, or 0 to 65535"));
    EXPECT_EQ(read("float", {"0 0 0 2 3 0 0"})->warnings.size(), 1u); // almost black, or brighter than white
}

TEST(LabelledPoints, no_prefix_of_a_file_reads_or_crashes)
{
    const ScratchFolder folder;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.cells = {{0, 0, 0}, {1, 0, 0}};
    grid.labels = {1, 2};
    ASSERT_TRUE(write_labelled_points(folder / "p.ply", grid));
    const std::string bytes = contents(folder / "p.ply");
    for (size_t n = 0; n < bytes.size(); ++n)
        EXPECT_FALSE(read_labelled_points(folder.put("t.ply", bytes.substr(0, n)), {})) << n;
}

} // namespace engine_labelled_points_test
} // namespace semrover
