// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// SemanticKITTI's files by hand from its README, Occ3D's by numpy 1.24.2 (tests/data/numpy)
#include "tools/dataset/dense_labels.h"
#include "tools/dataset/scene_readers.h"

#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/zip_bytes.h"

#include <cmath>
#include <random>

namespace semrover {
namespace engine_dense_grids_test {

const std::string kNumpy = SEMROVER_SOURCE_DIR "/tests/data/numpy/";
constexpr size_t kVoxels = 256 * 256 * 32;

size_t voxel(size_t x, size_t y, size_t z)
{
    return (x * 256 + y) * 32 + z;
}

std::optional<uint8_t> label_at(const VoxelGrid& grid, const Cell& cell)
{
    const auto found = find_cell(grid, cell);
    return found ? std::optional(grid.labels[*found]) : std::nullopt;
}

// ---- voxels to cells

DenseLabels random_labels(std::array<uint32_t, 3> shape, std::array<int64_t, 3> edge, std::array<int64_t, 3> origin)
{
    std::mt19937 random(11);
    DenseLabels dense{shape, edge, origin, {}};
    for (size_t i = 0; i < size_t(shape[0]) * shape[1] * shape[2]; ++i) {
        const uint32_t r = random() % 12;
        dense.labels.push_back(r < 4 ? uint8_t(r * 3) : r < 6 ? kLeftOut : kEmpty);
    }
    return dense;
}

// the rule, voxel by voxel: every voxel gives its overlap with every cell, in cubic metres
std::map<Cell, std::map<uint8_t, double>> votes_of(const DenseLabels& dense, double size)
{
    std::map<Cell, std::map<uint8_t, double>> votes;
    size_t at = 0;
    for (uint32_t x = 0; x < dense.shape[0]; ++x)
        for (uint32_t y = 0; y < dense.shape[1]; ++y)
            for (uint32_t z = 0; z < dense.shape[2]; ++z, ++at) {
                if (dense.labels[at] >= kClassCount)
                    continue;
                const uint32_t index[3] = {x, y, z};
                std::array<std::map<int32_t, double>, 3> lengths;
                for (size_t a = 0; a < 3; ++a) {
                    const double low = double(dense.origin[a] + index[a] * dense.edge[a]) * 1e-4;
                    const double high = low + double(dense.edge[a]) * 1e-4;
                    for (int32_t c = int32_t(std::floor(low / size)) - 1; c * size < high; ++c) {
                        const double l = std::min(high, (c + 1) * size) - std::max(low, c * size);
                        if (l > 1e-9)
                            lengths[a][c] = l;
                    }
                }
                for (const auto& [i, li] : lengths[0])
                    for (const auto& [j, lj] : lengths[1])
                        for (const auto& [k, lk] : lengths[2])
                            votes[{i, j, k}][dense.labels[at]] += li * lj * lk;
            }
    return votes;
}

TEST(DenseLabels, a_cell_takes_the_label_of_the_largest_volume)
{
    const struct {
        std::array<int64_t, 3> edge, origin;
        float size;
    } cases[] = {
        {{2000, 2000, 2000}, {0, -256000, -20000}, 0.6f},       // SemanticKITTI: 3 x 3 x 3
        {{4000, 4000, 4000}, {-400000, -400000, -10000}, 0.6f}, // Occ3D
        {{1000, 1000, 2000}, {-800000, -800000, -50000}, 0.6f}, // Occ3D-Waymo: 6 x 6 x 3
        {{6000, 6000, 6000}, {0, 0, 0}, 0.6f},
        {{10000, 7000, 3333}, {12345, -6789, 1}, 0.25f}, // cells smaller than voxels
    };
    for (const auto& c : cases)
        for (const double fill : {0.0, 0.25}) {
            const DenseLabels dense = random_labels({13, 10, 7}, c.edge, c.origin);
            const auto grid = resample(dense, c.size, fill, "here");
            ASSERT_TRUE(grid) << grid.error().message;
            EXPECT_TRUE(check_grid(*grid, "here"));
            size_t cells = 0;
            for (const auto& [cell, labels] : votes_of(dense, double(std::lround(c.size * 1e4)) * 1e-4)) {
                double volume = 0, best = 0;
                for (const auto& [label, v] : labels) {
                    volume += v;
                    best = std::max(best, v);
                }
                const double share = volume / std::pow(c.size, 3);
                if (share < fill - 1e-6) {
                    EXPECT_FALSE(find_cell(*grid, cell));
                    continue;
                }
                ++cells;
                uint8_t expected = kEmpty; // the lowest of those that are as large
                for (const auto& [label, v] : labels)
                    if (v > best - 1e-9 && expected == kEmpty)
                        expected = label;
                EXPECT_EQ(label_at(*grid, cell), expected);
            }
            EXPECT_EQ(grid->cells.size(), cells);
        }
}

TEST(DenseLabels, sizes_that_are_not_tenths_of_a_millimetre_are_refused)
{
    const DenseLabels dense = random_labels({2, 2, 2}, {2000, 2000, 2000}, {0, 0, 0});
    EXPECT_TRUE(says(resample(dense, 0.33333f, 0, "here"), "here: voxel size: 0.3333"));
    EXPECT_TRUE(says(resample(dense, 200.f, 0, "here"), "expected a voxel size of 0.001 to 100 m, found 200"));
    EXPECT_TRUE(says(resample(dense, 1e-5f, 0, "here"), "voxel size"));
    EXPECT_TRUE(says(tenths_of(NAN, "origin"), "origin: nan m"));
    EXPECT_EQ(*tenths_of(-25.6f, "x"), -256000);
    DenseLabels empty = dense;
    empty.labels.assign(8, kLeftOut);
    EXPECT_TRUE(says(resample(empty, 0.6f, 0, "here"), "here: no voxel is occupied"));
}

// one layer of voxels, which straddle the cells' boundaries, in a box of 8 x 8 columns
TEST(DenseLabels, a_doubled_ground_is_said)
{
    const auto ground = [](uint32_t height, double cell, double min_fill, int64_t shift = 0) {
        DenseLabels dense{{24, 24, 9}, {2000, 2000, 2000}, {0, 0, shift}, {}};
        dense.labels.assign(24 * 24 * 9, kEmpty);
        for (uint32_t i = 0; i < 24 * 24; ++i) // flat, or a slope from below a boundary to above it
            dense.labels[i * 9 + (height ? height : 2 + i % 24 % 3 / 2)] = 0;
        std::vector<std::string> warnings;
        const auto grid = resample(dense, float(cell), min_fill, "here", &warnings);
        EXPECT_TRUE(grid) << grid.error().message;
        return std::pair(grid->cells.size(), warnings);
    };
    EXPECT_EQ(ground(3, 0.6, 0), std::pair(size_t(64), std::vector<std::string>()));
    const auto [cells, warnings] = ground(0, 0.6, 0); // two of three voxels below the boundary, one above
    EXPECT_EQ(cells, 128u);
    EXPECT_EQ(warnings, std::vector<std::string>{
                            "64 of 64 columns of ground have two layers of cells: voxels of 0.2 m straddle the "
                            "boundaries of cells of 0.6 m; `voxel_size` 0.2 keeps the voxels as they are, `min_fill` "
                            "0.17 leaves out the emptier layer"});
    EXPECT_EQ(ground(0, 0.6, 0.17), std::pair(size_t(64), std::vector<std::string>()));
    EXPECT_EQ(ground(0, 0.2, 0), std::pair(size_t(576), std::vector<std::string>()));
    const auto [twice, shifted] = ground(3, 0.2, 0, 1000); // half a voxel higher
    EXPECT_EQ(twice, 1152u);
    ASSERT_EQ(shifted.size(), 1u);
    EXPECT_TRUE(shifted[0].ends_with("; `origin` in whole cells keeps the voxels as they are")) << shifted[0];
}

// ---- label maps

TEST(LabelMap, a_file_says_what_labels_are)
{
    const ScratchFolder folder;
    constexpr SourceLabel labels[] = {{7, "lamp", kLeftOut}, {8, "cat", kEmpty}};
    const auto apply = [&](const char* json) {
        LabelMap map{std::span<const SourceLabel>(labels)};
        const Status status = map.apply(folder.put("map.json", json));
        return status ? Result<LabelMap>(map) : Result<LabelMap>(tl::make_unexpected(status.error()));
    };
    LabelMap map = *apply(R"({"lamp": "pole", "9": 3, "10": null})");
    EXPECT_EQ(map(7), 5);
    EXPECT_EQ(map(8), kEmpty);
    EXPECT_EQ(map(9), 3);
    EXPECT_EQ(map(10, 4), kLeftOut);
    EXPECT_TRUE(map.check("here", "voxels"));
    EXPECT_EQ(map.dropped(), 4u);
    EXPECT_EQ(map.left_out("voxels"), std::vector<std::string>{"4 voxels of label 10 are left out"});
    EXPECT_EQ(map(77, 3), kLeftOut);
    EXPECT_EQ(map(99999), kLeftOut);
    EXPECT_TRUE(says(map.check("here", "voxels"), "here: unknown labels: 77 (3 voxels), 99999 (1 voxels); `map` says"));
    EXPECT_TRUE(says(apply("[]"), "expected an object of source label to class, found array"));
    EXPECT_TRUE(says(apply(R"({"lamp": "lamp"})"),
                     "'lamp': expected a class (name or 0 to 19), null or \"free\", found \"lamp\""));
    EXPECT_TRUE(says(apply(R"({"lamp": 20})"), "found 20"));
    EXPECT_TRUE(says(apply(R"({"lamp": -1})"), "found -1"));
    EXPECT_TRUE(says(apply(R"({"dog": 1})"), "'dog': the source has no label of that name"));
    EXPECT_TRUE(says(apply(R"({"lamp": 1)"), "map.json"));
    EXPECT_TRUE(
        says(LabelMap().apply(folder / "none.json"), "none.json': expected a file, or one of the tables ours, "));
    EXPECT_TRUE(says(apply(R"({"lamp": {"name": "a", "class": 1}})"), "of a number"));
    EXPECT_TRUE(says(apply(R"({"7": {"name": "a"}})"), "expected {\"name\": .., \"class\": ..}"));
}

TEST(LabelMap, a_table_by_name_is_the_file_of_that_name)
{
    constexpr std::array<std::tuple<const char*, uint32_t, uint8_t>, 23> cases = {{
        {"asprs", 2, 9},
        {"asprs", 5, 8},
        {"asprs", 6, 2},
        {"asprs", 7, kLeftOut},
        {"asprs", 11, 0},
        {"carla", 1, 0},
        {"carla", 24, 19},
        {"cityscapes", 7, 0},
        {"cityscapes", 11, 2},
        {"cityscapes", 26, 13},
        {"kitti360", 34, 2},
        {"kitti360", 37, 5},
        {"nuscenes", 17, 13},
        {"nuscenes", 24, 0},
        {"nuscenes", 30, 8},
        {"nyu40", 1, 3},
        {"nyu40", 31, 11},
        {"occ3d", 17, kEmpty},
        {"occ3d-waymo", 10, 2},
        {"semantickitti", 50, 2},
        {"semantickitti-train", 13, 2},
        {"semantickitti-train", 9, 0},
        {"ours", 13, 13},
    }};
    for (const auto& [name, number, target] : cases) {
        LabelMap map = *LabelMap::of(name);
        EXPECT_EQ(map(number), target) << name << ' ' << number;
        EXPECT_TRUE(map.check("here", "voxels"));
        EXPECT_EQ(map(200), kLeftOut); // nothing of the numbers from before is left
        EXPECT_TRUE(says(map.check("here", "voxels"), "unknown labels: 200"));
        const Path file = Path(SEMROVER_SOURCE_DIR "/assets/label_maps") / (std::string(name) + ".json");
        if (std::string_view(name) == "ours")
            continue;
        LabelMap of_file = LabelMap::identity();
        ASSERT_TRUE(of_file.apply(file));
        EXPECT_EQ(of_file(number), target) << file;
    }
    LabelMap map = LabelMap::identity();
    ASSERT_TRUE(map.apply("nuscenes"));
    EXPECT_EQ(map(0), kLeftOut); // not our road
    ASSERT_TRUE(map.apply("semantickitti"));
    EXPECT_EQ(map(2), kLeftOut);
    EXPECT_TRUE(says(map.check("here", "voxels"), "unknown labels: 2 (1 voxels)"));
}

TEST(LabelMap, a_column_of_another_program_needs_a_map)
{
    const ScratchFolder folder;
    constexpr LabelColumn las{"classification", "asprs"}, any{"label", ""};
    const auto ask = [](const Result<LabelMap>& made, std::initializer_list<uint32_t> numbers) {
        EXPECT_TRUE(made) << made.error().message;
        LabelMap map = *made;
        std::vector<uint8_t> targets;
        for (const uint32_t number : numbers)
            targets.push_back(map(number));
        return std::pair(map, targets);
    };
    auto [refused, unused] = ask(LabelMap::of_column(las, false, {}), {2, 6, 6, 77});
    EXPECT_TRUE(says(refused.check("p.ply", "points"),
                     "p.ply: 'classification': a column of that name holds numbers of asprs, not ours: 2 ground (1 "
                     "points, terrain), 6 building (2 points), 77 (1 points, unknown); `map` asprs takes"));
    auto [taken, terrain] = ask(LabelMap::of_column(las, false, "asprs"), {2, 6});
    EXPECT_EQ(terrain, (std::vector<uint8_t>{9, 2}));
    EXPECT_TRUE(taken.check("p.ply", "points"));
    auto [ours, same] = ask(LabelMap::of_column(las, false, "ours"), {2, 6});
    EXPECT_EQ(same, (std::vector<uint8_t>{2, 6}));
    const Path file = folder.put("map.json", R"({"6": "wall", "ground": "road"})");
    auto [partly, walls] = ask(LabelMap::of_column(las, false, file), {2, 6, 5});
    EXPECT_EQ(walls, (std::vector<uint8_t>{0, 3, kLeftOut})); // 5 is no pole: nothing of ours is behind the file
    EXPECT_TRUE(says(partly.check("p.ply", "points"), "unknown labels: 5 high vegetation (1 points)"));

    auto [anybody, numbers] = ask(LabelMap::of_column(any, false, {}), {2, 2, 5});
    EXPECT_EQ(numbers, (std::vector<uint8_t>{2, 2, 5}));
    EXPECT_TRUE(anybody.check("p.ply", "points"));
    EXPECT_EQ(anybody.assumed("p.ply", "points"),
              std::vector<std::string>{"p.ply: 'label': the numbers are taken for our own classes: 2 building (2 "
                                       "points), 5 pole (1 points); `map` says what they are if they are another "
                                       "program's"});
    auto [own, again] = ask(LabelMap::of_column(any, true, {}), {2, 2, 5});
    EXPECT_TRUE(own.assumed("p.ply", "points").empty());
    auto [raw, none] = ask(LabelMap::of_column(any, false, {}), {10, 252});
    EXPECT_TRUE(says(raw.check("p.ply", "points"),
                     "unknown labels: 252 (1 points); `map` says what they are; found are 10 sky (1 "
                     "points), 252 (1 points, unknown); all numbers of the file are in semantickitti"));
}

// ---- SemanticKITTI

struct Kitti {
    std::string labels = std::string(kVoxels * 2, '\0'), bits = std::string(kVoxels / 8, '\0');

    void set(size_t x, size_t y, size_t z, uint16_t raw)
    {
        labels[2 * voxel(x, y, z)] = static_cast<char>(raw & 255);
        labels[2 * voxel(x, y, z) + 1] = static_cast<char>(raw >> 8);
    }
};

TEST(SemanticKitti, voxels_become_cells_in_the_lidars_frame)
{
    const ScratchFolder folder;
    Kitti k;
    // voxel (0, 128, 10) begins at the lidar: cell (0, 0, 0) is voxels 0..2, 128..130, 10..12
    k.set(0, 128, 10, 40);
    k.set(1, 129, 11, 60);
    k.set(2, 130, 12, 60);
    k.set(3, 128, 10, 252);  // the next cell: a moving car
    k.set(0, 127, 10, 70);   // y -1: one voxel of cell -1
    k.set(0, 126, 9, 81);    // a tie in cell (0, -1, -1) ...
    k.set(0, 125, 9, 80);    // ... goes to the lower class: pole 5, traffic sign 7
    k.set(255, 0, 31, 99);   // other-object is left out
    k.set(255, 255, 31, 50); // the far corner: x 51.0..51.2, y 25.4..25.6, z 4.2..4.4
    const auto out = read_semantic_kitti(folder.put("000000.label", k.labels), {});
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{0, -1, -1}, {0, -1, 0}, {0, 0, 0}, {1, 0, 0}, {85, 42, 7}}));
    EXPECT_EQ(out->grid.labels, (std::vector<uint8_t>{5, 8, 19, 13, 2}));
    EXPECT_EQ(out->warnings, std::vector<std::string>{"1 voxels of label 99 (other-object) are left out"});
    EXPECT_EQ(out->dropped, 1u);

    SceneGridOptions o;
    o.map = folder.put("map.json", R"({"other-object": "fence", "40": null})");
    o.origin = {10.2, 0, 1.8};
    o.min_fill = 2 / 27.0;
    const auto mapped = read_semantic_kitti(folder / "000000.label", o);
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(mapped->grid.cells, (std::vector<Cell>{{17, -1, 2}, {17, 0, 3}})); // those with two voxels
    EXPECT_EQ(mapped->dropped, 1u);
}

TEST(SemanticKitti, bits_say_what_was_hit_and_what_could_be_seen)
{
    const ScratchFolder folder;
    Kitti k;
    for (size_t i = 0; i < 16; ++i)
        k.set(10 * (i / 8), 100, i % 8 * 4, 40); // eight voxels each in two rows, each a cell of its own
    folder.put("1.label", k.labels);
    std::string bits = k.bits;
    // voxels 0..7 of a row of 32 are one byte, the most significant bit first: 0x84 is voxels 0 and 5
    bits[voxel(0, 100, 0) / 8] = static_cast<char>(0x84);
    bits[voxel(10, 100, 24) / 8] = 0x08; // voxel 28
    const auto out = read_semantic_kitti(folder.put("1.bin", bits), {});
    ASSERT_TRUE(out) << out.error().message;
    // z of voxel 0 is -2 m, of voxel 28 3.6 m
    EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{0, -10, -4}, {3, -10, 6}}));
    folder.put("1.invalid", bits);
    const auto valid = read_semantic_kitti(folder / "1.label", {});
    ASSERT_TRUE(valid) << valid.error().message;
    EXPECT_EQ(valid->grid.cells.size(), 14u);
    EXPECT_FALSE(find_cell(valid->grid, {3, -10, 6}));
}

TEST(SemanticKitti, a_grid_comes_back_the_same)
{
    const ScratchFolder folder;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t x = 0; x < 86; x += 5)
        for (int32_t y = -43; y < 43; y += 3)
            for (int32_t z = -4; z < 8; ++z) {
                const auto label = static_cast<uint8_t>((x + y + z + 100) % 20);
                if (label == 10 || label == 6) // there is neither sky nor traffic light
                    continue;
                grid.cells.push_back({x, y, z});
                grid.labels.push_back(label);
            }
    std::vector<std::string> warnings;
    ASSERT_TRUE(write_semantic_kitti(folder / "2.bin", grid, warnings));
    EXPECT_TRUE(warnings.empty());
    for (const char* name : {"2.label", "2.bin"}) {
        const auto out = read_semantic_kitti(folder / name, {});
        ASSERT_TRUE(out) << out.error().message;
        EXPECT_EQ(out->grid.cells, grid.cells);
        EXPECT_EQ(out->grid.labels, grid.labels);
    }
    // a cell is 27 voxels
    const std::string labels = contents(folder / "2.label"), bits = contents(folder / "2.bin");
    ASSERT_EQ(labels.size(), kVoxels * 2);
    const size_t first = voxel(5, 128, 10); // cell 1 is empty, cell 5 begins at voxel 15
    EXPECT_EQ(labels[2 * first], 0);
    const auto expected = label_at(grid, {5, -1, 0}); // voxels 15..17, 125..127, 10..12
    ASSERT_EQ(expected, uint8_t(104 % 20));
    EXPECT_EQ(labels[2 * voxel(15, 127, 12)], 51); // 4: fence
    EXPECT_EQ(labels[2 * voxel(17, 125, 10)], 51);
    // voxels 10, 11, 12 of a column, and 13, 14, 15 of the cell above (label 5): bits 2..7 of the second byte
    EXPECT_EQ(static_cast<unsigned char>(bits[voxel(15, 127, 8) / 8]), 0xffu);
}

TEST(SemanticKitti, what_it_cannot_hold_is_refused_or_said)
{
    const ScratchFolder folder;
    std::vector<std::string> warnings;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.cells = {{0, 0, 0}, {0, 0, 1}, {0, 0, 8}};
    grid.labels = {6, 10, 0};
    EXPECT_TRUE(says(write_semantic_kitti(folder / "x.label", grid, warnings),
                     "1 of 3 cells are outside its box of 0 to 51.2, -25.6 to 25.6, -2 to 4.4 m"));
    grid.voxel_size = 0.5f;
    EXPECT_TRUE(says(write_semantic_kitti(folder / "x.label", grid, warnings), "cells of 0.5 m cannot be split"));
    EXPECT_EQ(folder.entries(), 0u);
    grid.voxel_size = 0.4f;
    EXPECT_TRUE(write_semantic_kitti(folder / "x.label", grid, warnings));
    EXPECT_EQ(warnings, (std::vector<std::string>{"1 cells of traffic light become traffic-sign",
                                                  "1 cells of sky are left out"}));
}

TEST(SemanticKitti, training_ids_are_no_raw_ids)
{
    const ScratchFolder folder;
    Kitti k; // car and road in training ids; 1 is an outlier of the raw ids, and 9 none
    k.set(0, 128, 10, 1);
    k.set(3, 128, 10, 9);
    const Path file = folder.put("0.label", k.labels);
    EXPECT_TRUE(says(read_semantic_kitti(file, {}), "the largest number is 9: these may be SemanticKITTI's raw ids, or "
                                                    "its training ids; `map` semantickitti or"));
    SceneGridOptions o;
    o.map = "semantickitti-train";
    const auto out = read_semantic_kitti(file, o);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(label_at(out->grid, {0, 0, 0}), 13);
    EXPECT_EQ(label_at(out->grid, {1, 0, 0}), 0);
    o.map = "semantickitti";
    EXPECT_TRUE(says(read_semantic_kitti(file, o), "unknown labels: 9 (1 voxels)"));
}

TEST(SemanticKitti, refuses_malformed_files)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& labels, const SceneGridOptions& o = {}) {
        return read_semantic_kitti(folder.put("m.label", labels), o);
    };
    const Kitti empty;
    EXPECT_TRUE(says(read_semantic_kitti(folder / "none.label", {}), "none.label"));
    EXPECT_TRUE(says(read(""), "expected 4194304 bytes for 256 x 256 x 32 voxels, found 0"));
    EXPECT_TRUE(says(read(empty.labels.substr(1)), "found 4194303"));
    EXPECT_TRUE(says(read(empty.labels + "x"), "m.label"));
    EXPECT_TRUE(says(read(empty.labels), "no voxel is occupied"));
    Kitti unknown;
    unknown.set(0, 0, 0, 1000);
    unknown.set(0, 0, 1, 1000);
    unknown.set(0, 0, 2, 41);
    EXPECT_TRUE(says(read(unknown.labels), "unknown labels: 41 (1 voxels), 1000 (2 voxels); `map` says"));
    Kitti good;
    good.set(0, 0, 0, 40);
    EXPECT_TRUE(read(good.labels));
    SceneGridOptions o;
    o.map = folder.put("bad.json", "{");
    EXPECT_TRUE(says(read(good.labels, o), "bad.json"));
    o.map = folder.put("bad.json", R"({"street": 0})");
    EXPECT_TRUE(says(read(good.labels, o), "'street': the source has no label of that name"));
    o = {};
    o.origin = {0, -1e7, 0};
    EXPECT_TRUE(says(read(good.labels, o), "cell -16666710 is absurd: expected coordinates within 2^20"));
    o.origin = {0.00005, 0, 0};
    EXPECT_TRUE(says(read(good.labels, o), "origin: 5e-05 m: expected whole tenths"));
    o = {};
    o.voxel_size = 0.12345f;
    EXPECT_TRUE(says(read(good.labels, o), "voxel size"));
    o.voxel_size = 0.001f;
    EXPECT_TRUE(says(read(good.labels, o), "a voxel size of 0.001 m makes 1.68e+13 cells of its box"));
    o = {};
    o.min_fill = 0.5;
    EXPECT_TRUE(says(read(good.labels, o), "no voxel is occupied"));
    EXPECT_TRUE(says(read_semantic_kitti(folder.put("alone.bin", empty.bits), {}), "occupancy without labels"));
    EXPECT_TRUE(says(read_semantic_kitti(folder.put("m.bin", "short"), {}), "m.bin': expected 262144 bytes"));
    folder.put("m.invalid", "short");
    EXPECT_TRUE(says(read(good.labels), "m.invalid': expected 262144 bytes"));
}

// ---- Occ3D

TEST(Occ3d, nuscenes_voxels_vote_with_their_volume)
{
    const auto out = read_occ3d(kNumpy + "occ3d_nuscenes.npz", Occ3dKind::nuscenes, {});
    ASSERT_TRUE(out) << out.error().message;
    // the road is x, y from -40 to -36.4, z from -1 to -0.2: cells -67 to -61, and -2 to -1
    EXPECT_EQ(label_at(out->grid, {-67, -67, -2}), 0);
    EXPECT_EQ(label_at(out->grid, {-61, -61, -1}), 0);
    EXPECT_EQ(label_at(out->grid, {-60, -61, -1}), std::nullopt);
    // the car is x, y from -38.8 to -37.6, z from -0.2 to 0.2: cell 0 has nothing else, cell -1 more road
    EXPECT_EQ(label_at(out->grid, {-64, -64, 0}), 13);
    EXPECT_EQ(label_at(out->grid, {-64, -64, -1}), 0);
    EXPECT_EQ(out->grid.cells.size(), 7u * 7 * 2 + 3 * 3);
    EXPECT_EQ(out->warnings, std::vector<std::string>{"1 voxels of label 0 (others) are left out"});
    SceneGridOptions o;
    o.mask = "mask_lidar"; // the road only
    const auto masked = read_occ3d(kNumpy + "occ3d_nuscenes.npz", Occ3dKind::nuscenes, o);
    ASSERT_TRUE(masked) << masked.error().message;
    EXPECT_EQ(masked->grid.cells.size(), 7u * 7 * 2);
    o.mask = "mask_radar";
    EXPECT_TRUE(says(read_occ3d(kNumpy + "occ3d_nuscenes.npz", Occ3dKind::nuscenes, o), "has no array 'mask_radar'"));
}

TEST(Occ3d, waymo_has_classes_of_its_own)
{
    SceneGridOptions o;
    o.voxel_size = 0.4f;
    o.origin = {0, 0, 0.2}; // -1 m is no multiple of 0.4
    const auto out = read_occ3d(kNumpy + "occ3d_waymo.npz", Occ3dKind::waymo, o);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells.size(), 10u);
    EXPECT_EQ(label_at(out->grid, {-100, -100, -2}), 0);
    EXPECT_EQ(label_at(out->grid, {-100, -100, -1}), 5);
    EXPECT_EQ(label_at(out->grid, {-98, -98, -2}), 0);
}

TEST(Occ3d, labels_are_of_any_type)
{
    const ScratchFolder folder;
    const auto npy = [](const char* type, auto free, auto car) {
        std::vector<decltype(free)> numbers(200 * 200 * 16, free);
        numbers[0] = car;
        return npy_bytes(type, "(200, 200, 16)",
                         {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(free)});
    };
    for (const std::string& bytes : {npy("|u1", uint8_t(17), uint8_t(4)), npy("<i8", int64_t(17), int64_t(4)),
                                     npy("<i4", int32_t(17), int32_t(4)), npy("<f4", 17.f, 4.f)}) {
        const Path file = folder.put("m.npz", zip_bytes({{"semantics.npy", bytes}}));
        const auto out = read_occ3d(file, Occ3dKind::nuscenes, {});
        ASSERT_TRUE(out) << out.error().message;
        EXPECT_EQ(out->grid.labels[0], 13);
        EXPECT_EQ(out->grid.cells[0], (Cell{-67, -67, -2})); // 0.4 m at -40, -40, -1: two cells high
    }
    const Path half = folder.put("m.npz", zip_bytes({{"semantics.npy", npy("<f4", 17.f, 4.5f)}}));
    EXPECT_TRUE(says(read_occ3d(half, Occ3dKind::nuscenes, {}), "expected whole numbers of 0 to 255, found another"));
}

TEST(Occ3d, refuses_malformed_files)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& name, const std::string& npy, Occ3dKind kind = Occ3dKind::nuscenes) {
        return read_occ3d(folder.put("m.npz", zip_bytes({{name + ".npy", npy}})), kind, {});
    };
    const std::string free(200 * 200 * 16, '\x11');
    EXPECT_TRUE(says(read_occ3d(folder / "none.npz", Occ3dKind::nuscenes, {}), "none.npz"));
    EXPECT_TRUE(says(read_occ3d(folder.put("m.npz", "text"), Occ3dKind::nuscenes, {}), "no .npz archive"));
    EXPECT_TRUE(says(read("labels", ""), "has no array 'semantics', found labels"));
    EXPECT_TRUE(says(read("semantics", npy_bytes("|u1", "(2, 2, 2)", "abcdefgh")),
                     "'semantics': expected shape [200, 200, 16], found [2, 2, 2]"));
    EXPECT_TRUE(says(read("semantics", npy_bytes("|u1", "(640000,)", free)), "expected shape [200, 200, 16]"));
    EXPECT_TRUE(says(read("semantics", npy_bytes("<i8", "(200, 200, 16)", free)), "the zip says"));
    EXPECT_TRUE(says(read("semantics", npy_bytes("|i1", "(200, 200, 16)", "\xff" + free.substr(1))),
                     "'semantics': expected whole numbers of 0 to 255, found another"));
    EXPECT_TRUE(says(read("semantics", npy_bytes("|u1", "(200, 200, 16)", free.substr(1))), "the zip says"));
    EXPECT_TRUE(says(read("semantics", npy_bytes("|u1", "(200, 200, 16)", free)), "no voxel is occupied"));
    std::string unknown = free;
    unknown[5] = unknown[6] = '\xff';
    unknown[7] = 18;
    EXPECT_TRUE(says(read("semantics", npy_bytes("|u1", "(200, 200, 16)", unknown)),
                     "unknown labels: 18 (1 voxels), 255 (2 voxels)"));
    EXPECT_TRUE(says(read("voxel_label", npy_bytes("|u1", "(200, 200, 16)", free), Occ3dKind::waymo),
                     "unknown labels: 17 (640000 voxels)"));
    EXPECT_TRUE(
        says(read("voxel_label", npy_bytes("|u1", "(1600, 1600, 64)", "abc"), Occ3dKind::waymo), "the zip says"));
    const std::string wrong_mask = npy_bytes("|u1", "(2,)", "ab");
    SceneGridOptions o;
    o.mask = "m";
    const auto masked = zip_bytes({{"semantics.npy", npy_bytes("|u1", "(200, 200, 16)", free)}, {"m.npy", wrong_mask}});
    EXPECT_TRUE(says(read_occ3d(folder.put("m.npz", masked), Occ3dKind::nuscenes, o), "'m': expected shape [200"));
}

} // namespace engine_dense_grids_test
} // namespace semrover
