// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// files by numpy 1.24.2 (tests/data/numpy), and by hand from the formats' specifications
#include "tools/dataset/npz.h"
#include "tools/dataset/scene_file.h"
#include "tools/dataset/scene_readers.h"

#include "tests/support/grid_case.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/zip_bytes.h"

#include <cmath>
#include <numeric>

namespace semrover {
namespace engine_npz_test {

const std::string kNumpy = SEMROVER_SOURCE_DIR "/tests/data/numpy/";

NpyArray read(const NpzFile& file, std::string_view name)
{
    const Result<NpyArray> array = file.read(name);
    if (!array)
        throw std::runtime_error(array.error().message);
    return *array;
}

std::string text_of(const std::vector<std::byte>& bytes)
{
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(Npz, reads_every_header_that_numpy_writes)
{
    const auto file = NpzFile::open(kNumpy + "arrays.npz");
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(file->names().size(), 8u);
    std::vector<int32_t> expected(24);
    std::iota(expected.begin(), expected.end(), 0);
    const std::vector<uint64_t> shape = {2, 3, 4};
    EXPECT_EQ(read(*file, "big").values<int32_t>(), expected);
    EXPECT_EQ(read(*file, "big").shape, shape);
    EXPECT_EQ(read(*file, "fortran").values<int16_t>(), std::vector<int16_t>(expected.begin(), expected.end()));
    EXPECT_EQ(read(*file, "both").values<double>(), std::vector<double>(expected.begin(), expected.end()));
    EXPECT_EQ(read(*file, "both").shape, shape);
    EXPECT_EQ(read(*file, "scalar").dtype, DType::f16);
    EXPECT_TRUE(read(*file, "scalar").shape.empty());
    EXPECT_EQ(half_to_float(read(*file, "scalar").values<uint16_t>()[0]), 0.25f);
    EXPECT_EQ(read(*file, "empty").shape, (std::vector<uint64_t>{0, 3}));
    EXPECT_EQ(read(*file, "empty").data.size(), 0u);
    EXPECT_EQ(read(*file, "flags").values<uint8_t>(), (std::vector<uint8_t>{1, 0}));
    EXPECT_TRUE(says(file->read("text"), "'text': .npy header: a type '<U2'"));
    EXPECT_TRUE(says(file->read("record"), "'record': .npy header: a structured type"));
    EXPECT_TRUE(says(file->read("none"), "has no array 'none', found big, both, "));
}

TEST(Npz, writes_what_the_specifications_say)
{
    const ScratchFolder folder;
    NpyArray array{DType::u8, {2, 1}, {std::byte(7), std::byte(8)}};
    ASSERT_TRUE(write_npz(folder / "a.npz", {{"x", array}}));
    const std::string npy = text_of(encode_npy(array));
    ASSERT_EQ(npy.size(), 64u * 2 + 2);
    EXPECT_EQ(npy.substr(0, 10), std::string("\x93NUMPY\1\0\x76\0", 10));
    EXPECT_TRUE(npy.substr(10).starts_with("{'descr': '|u1', 'fortran_order': False, 'shape': (2, 1), }"));
    EXPECT_EQ(npy[127], '\n');
    EXPECT_EQ(text_of(encode_npy({DType::f32, {5}, {}})).find("(5,)"), 60u);
    EXPECT_NE(text_of(encode_npy({DType::f32, {}, {}})).find("'<f4', 'fortran_order': False, 'shape': ()"),
              std::string::npos);
    // the archive is the one made by hand, but for the versions of the program that libzip writes into it
    const std::string zip = contents(folder / "a.npz"), expected = zip_bytes({{"x.npy", npy}});
    ASSERT_EQ(zip.size(), expected.size());
    size_t differing = 0;
    for (size_t i = 0; i < zip.size(); ++i)
        differing += zip[i] != expected[i];
    EXPECT_LE(differing, 16u);
    EXPECT_EQ(zip.find(npy), expected.find(npy));
    ASSERT_TRUE(write_npz(folder / "b.npz", {{"x", array}}));
    EXPECT_EQ(contents(folder / "b.npz"), zip); // the same bytes, whenever it is written
}

TEST(Npz, refuses_malformed_archives)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& bytes) {
        const auto file = NpzFile::open(folder.put("m.npz", bytes));
        return file ? file->read("a") : Result<NpyArray>(tl::make_unexpected(file.error()));
    };
    const auto npy = [&](const std::string& bytes) { return read(zip_bytes({{"a.npy", bytes}})); };
    const std::string good = npy_bytes("|u1", "(4,)", "abcd");
    ASSERT_TRUE(npy(good)) << npy(good).error().message;
    EXPECT_TRUE(says(NpzFile::open(folder / "none.npz"), "none.npz"));
    EXPECT_TRUE(says(read("PK"), "no .npz archive"));
    EXPECT_TRUE(says(read(""), "found none"));
    EXPECT_TRUE(says(read(zip_bytes({{"b.npy", good}, {"c.txt", ""}})), "has no array 'a', found b"));
    EXPECT_TRUE(says(read(zip_bytes({})), "found none"));
    EXPECT_TRUE(says(read(zip_bytes({{"a.npy", good}, {"a.npy", good}})), "two entries 'a.npy'"));
    std::vector<std::pair<std::string, std::string>> many(1025);
    for (size_t i = 0; i < many.size(); ++i)
        many[i].first = std::to_string(i) + ".npy";
    EXPECT_TRUE(says(read(zip_bytes(many)), "1025 entries, at most 1024 are allowed"));
    EXPECT_TRUE(says(read(zip_bytes({{"a.npy", good}}, 8)), "cannot inflate 'a'")); // stored, but said to be deflated
    EXPECT_TRUE(says(read(zip_bytes({{"a.npy", good}}, 97)), "cannot read the entry 'a'"));
    std::string bad_crc = zip_bytes({{"a.npy", good}});
    bad_crc[bad_crc.find("abcd")] = 'x';
    EXPECT_TRUE(says(read(bad_crc), "cannot inflate 'a': CRC error"));
    EXPECT_TRUE(says(npy(npy_bytes("|u1", "(5,)", "abcd")), "the zip says"));
    EXPECT_TRUE(says(npy(npy_bytes("|u1", "(3,)", "abcd")), "the zip says"));
}

TEST(Npz, refuses_malformed_arrays)
{
    const ScratchFolder folder;
    const auto npy = [&](const std::string& bytes) {
        return NpzFile::open(folder.put("m.npz", zip_bytes({{"a.npy", bytes}})))->read("a");
    };
    const auto header = [&](const std::string& text) { return npy(npy_bytes(text, "abcd")); };
    EXPECT_TRUE(says(npy("garbage and more"), "no .npy array: it starts with 'garbage '"));
    EXPECT_TRUE(says(npy(""), "no .npy array"));
    EXPECT_TRUE(says(npy("\x93NUMPY\4" + std::string(9, '\0')), ".npy version 4.0"));
    EXPECT_TRUE(says(npy("\x93NUMPY\1" + std::string("\0\xff\x7f", 3)), "the .npy header is cut short"));
    EXPECT_TRUE(says(npy("\x93NUMPY\2" + std::string("\0\xff\xff\xff\x7f", 5)), "a .npy header of 2147483647 bytes"));
    EXPECT_TRUE(says(header("hello"), "expected '{' at byte 0"));
    EXPECT_TRUE(says(header("{'descr' '<f4'}"), "expected ':'"));
    EXPECT_TRUE(says(header("{'descr': '<f4', 'descr': '<f4'}"), "a field 'descr' twice"));
    EXPECT_TRUE(says(header("{'color': 1}"), "a field 'color'"));
    EXPECT_TRUE(says(header("{'descr': '<c8'}"), "a type '<c8'"));
    EXPECT_TRUE(says(header("{'descr': ''}"), "a type ''"));
    EXPECT_TRUE(says(header("{'descr': [('a', '<f4')]}"), "a structured type"));
    EXPECT_TRUE(says(header("{'descr': '|O'}"), "a type '|O'")); // pickled objects
    EXPECT_TRUE(says(header("{'descr': '<f4'}"), "expected descr, fortran_order and shape"));
    EXPECT_TRUE(says(header("{'fortran_order': yes}"), "expected True or False"));
    EXPECT_TRUE(says(header("{'shape': (-1,)}"), "shape: expected a number"));
    EXPECT_TRUE(says(header("{'shape': (1 2)}"), "shape: expected ',' or ')'"));
    EXPECT_TRUE(says(header("{'shape': (1,1,1,1,1,1,1,1,1)}"), "more than 8 dimensions"));
    EXPECT_TRUE(says(header("{'shape': (99999999999999999999,)}"), "shape: expected a number"));
    EXPECT_TRUE(says(header("{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296)}"),
                     "an absurd .npy shape"));
    EXPECT_TRUE(says(header("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 4294967296, 4294967296)}"),
                     "an absurd .npy shape"));
    EXPECT_TRUE(says(header("{'descr': '|u1', 'fortran_order': False, 'shape': (4,)} x"), "text follows"));
}

TEST(Npz, a_bomb_is_refused_before_it_is_inflated)
{
    const auto bomb = NpzFile::open(kNumpy + "bomb.npz");
    ASSERT_TRUE(bomb) << bomb.error().message;
    EXPECT_TRUE(says(bomb->read("cells"), "the zip says 67109000 bytes, the array's header 136"));
    SceneGridOptions sized;
    sized.voxel_size = 0.6f;
    EXPECT_TRUE(says(read_grid_npz(kNumpy + "bomb.npz", sized), "cells: expected shape [V, 3], found [8]"));
    const ScratchFolder folder;
    // an array of a terabyte in a few bytes, and one beyond what the reader expects
    const auto read = [&](const std::string& shape, uint64_t most) {
        const std::string npy = npy_bytes("|u1", shape, "abcd");
        return NpzFile::open(folder.put("m.npz", zip_bytes({{"a.npy", npy}})))->read("a", most);
    };
    EXPECT_TRUE(
        says(read("(1099511627776,)", kMaxNpzArrayBytes), "an array of 1099511627776 bytes, at most 4294967296"));
    EXPECT_TRUE(says(read("(4,)", 3), "an array of 4 bytes, at most 3 are expected"));
    // the directory lies about the size: what is inflated is more than it says
    std::string lies = contents(kNumpy + "bomb.npz");
    const std::string real("\x88\x00\x00\x04", 4), small("\x88\x00\x00\x00", 4);
    for (size_t at = lies.find(real); at != std::string::npos; at = lies.find(real))
        lies.replace(at, 4, small);
    const auto file = NpzFile::open(folder.put("l.npz", lies));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_TRUE(says(file->read("cells"), "'cells': expected 8 bytes of data, found more"));
}

TEST(Npz, no_prefix_of_an_archive_reads_or_crashes)
{
    const ScratchFolder folder;
    const std::string npy = npy_bytes("<u2", "(2, 3)", "abcdefghijkl");
    const std::string zip = zip_bytes({{"a.npy", npy}});
    for (size_t n = 0; n < zip.size(); ++n) {
        const auto file = NpzFile::open(folder.put("p.npz", zip.substr(0, n)));
        EXPECT_FALSE(file && file->read("a")) << n;
    }
    for (size_t n = 0; n < npy.size(); ++n) {
        const auto file = NpzFile::open(folder.put("p.npz", zip_bytes({{"a.npy", npy.substr(0, n)}})));
        ASSERT_TRUE(file);
        EXPECT_FALSE(file->read("a")) << n;
    }
}

// ---- the mirror of a .sgrid

// with text that has to be escaped
VoxelGrid quoted_grid()
{
    VoxelGrid grid = small_grid();
    grid.metadata["name"] = "small \"one\"";
    return grid;
}

TEST(GridNpz, a_grid_comes_back_the_same)
{
    const ScratchFolder folder;
    VoxelGrid grid = quoted_grid();
    for (int i = 0; i < 2; ++i) {
        ASSERT_TRUE(write_grid_npz(folder / "g.npz", grid));
        const auto read = read_grid_npz(folder / "g.npz", {});
        ASSERT_TRUE(read) << read.error().message;
        expect_same(read->grid, grid);
        EXPECT_TRUE(read->warnings.empty());
        grid.points.clear();
        grid.colors.clear();
        grid.generated.clear();
    }
}

TEST(GridNpz, numpys_default_types_are_taken)
{
    const auto read = read_grid_npz(kNumpy + "grid.npz", {});
    ASSERT_TRUE(read) << read.error().message;
    const VoxelGrid* grid = &read->grid;
    EXPECT_EQ(grid->voxel_size, 0.6f);
    EXPECT_EQ(grid->cells, (std::vector<Cell>{{0, -5, 3}, {2, 0, -1}})); // sorted
    EXPECT_EQ(grid->labels, (std::vector<uint8_t>{4, 19}));
    EXPECT_EQ(grid->points_per_voxel, 3);
    EXPECT_EQ(half_to_float(grid->points[0]), 0.f);
    EXPECT_EQ(half_to_float(grid->points[9]), -9 / 32.f);
    EXPECT_EQ(grid->colors[0], 9);
    EXPECT_EQ(grid->generated, (std::vector<uint8_t>{1, 1}));
}

// 6 x 3 voxels of 0.2 m, road and car, and a tree alone
VoxelGrid finer_grid()
{
    VoxelGrid grid;
    grid.voxel_size = 0.2f;
    for (int32_t i = 0; i < 6; ++i)
        for (int32_t j = 0; j < 3; ++j) {
            grid.cells.push_back({i, j, 0});
            grid.labels.push_back(i < 3 ? 0 : 13);
        }
    grid.cells.push_back({6, 0, 0});
    grid.labels.push_back(8);
    return grid;
}

TEST(GridNpz, finer_cells_become_larger_ones)
{
    const ScratchFolder folder;
    VoxelGrid grid = finer_grid();
    ASSERT_TRUE(write_grid_npz(folder / "g.npz", grid));
    SceneGridOptions o;
    const auto read = [&] { return read_grid_npz(folder / "g.npz", o); };
    EXPECT_EQ(read()->grid.cells.size(), 19u); // their own size
    EXPECT_EQ(read()->grid.voxel_size, 0.2f);
    o.voxel_size = 0.6f;
    EXPECT_EQ(read()->grid.cells, (std::vector<Cell>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
    EXPECT_EQ(read()->grid.labels, (std::vector<uint8_t>{0, 13, 8}));
    EXPECT_EQ(read()->grid.voxel_size, 0.6f);
    o.min_fill = 0.3;
    EXPECT_EQ(read()->grid.cells.size(), 2u);
    o.min_fill = 0;
    o.origin = {-0.2, 0, 0};
    EXPECT_EQ(read()->grid.cells, (std::vector<Cell>{{-1, 0, 0}, {0, 0, 0}, {1, 0, 0}}));
    o.origin = {0.1, 0, 0};
    EXPECT_TRUE(says(read(), "origin: 0.1 m is not a whole number of voxels of 0.2 m"));
    o = {};
    o.voxel_size = 0.5f;
    EXPECT_TRUE(says(read(), "a cell of 0.5 m is not a whole number of voxels of 0.2 m"));
    o = {};
    o.file_voxel_size = 0.1;
    EXPECT_TRUE(says(read(), "says that its voxels are 0.2 m, `file_voxel_size` says 0.1 m"));
    o = {};
    o.map = folder.put("map.json", R"({"13": null, "0": "terrain"})");
    EXPECT_EQ(read()->grid.cells.size(), 10u);
    EXPECT_EQ(read()->grid.labels[0], 9);
    EXPECT_EQ(read()->dropped, 9u);
    grid = small_grid();
    ASSERT_TRUE(write_grid_npz(folder / "g.npz", grid));
    o = {};
    o.voxel_size = 2 * grid.voxel_size;
    EXPECT_TRUE(says(read(), "have points, which cells of 1.2 m cannot take over"));
}

TEST(GridNpz, a_file_of_others_says_its_size_and_its_classes)
{
    const ScratchFolder folder;
    const std::string cell = std::string("\1\0\0\0\2\0\0\0\3\0\0\0", 12);
    const auto read = [&](const char* label, const SceneGridOptions& o) {
        return read_grid_npz(folder.put("m.npz", zip_bytes({{"cells.npy", npy_bytes("<i4", "(1, 3)", cell)},
                                                            {"labels.npy", npy_bytes("|u1", "(1,)", label)}})),
                             o);
    };
    EXPECT_TRUE(says(read("\3", {}), "does not say how large its voxels are: `voxel_size` does"));
    SceneGridOptions o;
    o.voxel_size = 0.4f;
    EXPECT_EQ(read("\3", o)->grid.voxel_size, 0.4f);
    EXPECT_EQ(read("\3", o)->grid.cells, (std::vector<Cell>{{1, 2, 3}}));
    ASSERT_EQ(read("\3", o)->warnings.size(), 1u);
    EXPECT_NE(read("\3", o)->warnings[0].find("taken for our own classes: 3 wall (1 cells)"), std::string::npos);
    EXPECT_TRUE(says(read("\x28", o), "unknown labels: 40 (1 cells)"));
    o.map = "semantickitti";
    EXPECT_EQ(read("\x28", o)->grid.labels, std::vector<uint8_t>{0});
    o = {};
    o.file_voxel_size = 0.2;
    EXPECT_EQ(read("\3", o)->grid.cells, (std::vector<Cell>{{0, 0, 1}})); // of 0.6 m
}

// ---- arrays of labels

template <typename T>
std::string npy_of(const char* type, const std::string& shape, const std::vector<T>& values)
{
    return npy_bytes(type, shape, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
}

TEST(LabelArray, a_dense_array_of_any_type_becomes_a_grid)
{
    const ScratchFolder folder;
    SceneGridOptions o;
    o.map = "occ3d";
    o.voxel_size = 0.4f;
    o.origin = {-0.4, 0, 0};
    const std::vector<int> numbers = {17, 17, 4, 17, 17, 17, 17, 11}; // [2, 2, 2]
    const auto expect = [&](const std::string& name, const std::string& bytes) {
        const Path file = folder.put(name, bytes);
        EXPECT_EQ(detect_scene_format(file).value(), SceneFormat::array);
        const auto out = read_scene_grid(file, o);
        ASSERT_TRUE(out) << out.error().message;
        EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{-1, 1, 0}, {0, 1, 1}}));
        EXPECT_EQ(out->grid.labels, (std::vector<uint8_t>{13, 0}));
        EXPECT_EQ(out->grid.voxel_size, 0.4f);
        EXPECT_TRUE(out->warnings.empty());
    };
    const auto as = [&](auto zero) { return std::vector<decltype(zero)>(numbers.begin(), numbers.end()); };
    expect("a.npy", npy_of("|u1", "(2, 2, 2)", as(uint8_t())));
    expect("a.npy", npy_of("<i8", "(2, 2, 2)", as(int64_t())));
    expect("a.npy", npy_of("<u2", "(1, 2, 2, 2)", as(uint16_t())));
    expect("a.npy", npy_of("<f4", "(2, 2, 2)", as(float())));
    expect("a.npz", zip_bytes({{"pred.npy", npy_of("<i4", "(2, 2, 2)", as(int32_t()))}}));
    expect("a.npz", zip_bytes({{"semantics.npy", npy_of("<i4", "(2, 2, 2)", as(int32_t()))},
                               {"times.npy", npy_of("<f4", "(2,)", std::vector<float>{1, 2})}}));
    // rows of x, y, z and a label
    expect("l.npy", npy_of("<i4", "(2, 4)", std::vector<int32_t>{0, 1, 0, 4, 1, 1, 1, 11}));

    o.map = folder.put("map.json", R"({"0": "free", "1": "building"})");
    const auto occupied =
        read_scene_grid(folder.put("b.npy", npy_of("|b1", "(2, 1, 1)", std::vector<uint8_t>{0, 1})), o);
    ASSERT_TRUE(occupied) << occupied.error().message;
    EXPECT_EQ(occupied->grid.cells, (std::vector<Cell>{{0, 0, 0}}));
    EXPECT_EQ(occupied->grid.labels, std::vector<uint8_t>{2});
}

TEST(LabelArray, sizes_are_those_of_options_or_of_the_file)
{
    const ScratchFolder folder;
    std::vector<uint8_t> road(3 * 3 * 3, 0);
    const std::string array = npy_of("|u1", "(3, 3, 3)", road);
    const Path npy = folder.put("a.npy", array);
    SceneGridOptions o;
    o.map = "ours";
    EXPECT_TRUE(says(read_scene_grid(npy, o), "does not say how large its voxels are"));
    o.file_voxel_size = 0.2;
    const auto cell = read_scene_grid(npy, o);
    ASSERT_TRUE(cell) << cell.error().message;
    EXPECT_EQ(cell->grid.cells, (std::vector<Cell>{{0, 0, 0}}));
    EXPECT_EQ(cell->grid.voxel_size, 0.6f);
    ASSERT_EQ(cell->warnings.size(), 2u); // where it lies, and that nothing is free
    EXPECT_NE(cell->warnings[0].find("all voxels are occupied"), std::string::npos);
    EXPECT_NE(cell->warnings[1].find("its corner lies at (0, 0, 0) m"), std::string::npos);
    o.file_voxel_size = 0;
    const Path npz = folder.put(
        "a.npz", zip_bytes({{"grid.npy", array}, {"voxel_size.npy", npy_of("<f4", "()", std::vector<float>{0.2f})}}));
    EXPECT_EQ(read_scene_grid(npz, o)->grid.cells.size(), 1u);
    o.voxel_size = 0.2f;
    EXPECT_EQ(read_scene_grid(npz, o)->grid.cells.size(), 27u);
    for (const float metres : {0.f, -1.f, 1e7f, INFINITY, NAN}) {
        const Path absurd = folder.put(
            "x.npz", zip_bytes({{"grid.npy", array}, {"voxel_size.npy", npy_of("<f4", "()", std::vector{metres})}}));
        EXPECT_FALSE(read_scene_grid(absurd, o)) << metres;
    }
}

TEST(LabelArray, what_is_no_labels_is_refused_with_words)
{
    const ScratchFolder folder;
    SceneGridOptions o;
    o.voxel_size = 0.4f;
    const auto read = [&](const std::string& bytes) { return read_scene_grid(folder.put("a.npy", bytes), o); };
    EXPECT_TRUE(says(read(npy_of("|u1", "(1, 1, 3)", std::vector<uint8_t>{40, 40, 50})),
                     "unknown labels: 40 (2 voxels), 50 (1 voxels); `map` says what they are; all numbers "
                     "of the file are in semantickitti"));
    o.map = "semantickitti";
    EXPECT_TRUE(says(read(npy_of("|u1", "(2, 2)", std::vector<uint8_t>(4))),
                     "expected labels [X, Y, Z] or rows [N, 4], found [2, 2]"));
    EXPECT_TRUE(says(read(npy_of("<f4", "(1, 1, 1)", std::vector<float>{0.5f})), "expected whole numbers"));
    EXPECT_TRUE(says(read(npy_of("<f4", "(1, 1, 1)", std::vector<float>{NAN})), "expected whole numbers"));
    EXPECT_TRUE(says(read(npy_of("|i1", "(1, 1, 1)", std::vector<int8_t>{-1})), "expected whole numbers"));
    EXPECT_TRUE(says(read(npy_of("|u1", "(0, 1, 1)", std::vector<uint8_t>{})), "0 voxels, expected 1 to"));
    EXPECT_TRUE(says(read(npy_of("|u1", "(1, 1, 2)", std::vector<uint8_t>{0})), "expected 2 bytes of data, found 1"));
    EXPECT_TRUE(says(read(npy_of("|u1", "(1, 1, 1)", std::vector<uint8_t>{0})), "no voxel is occupied"));
    EXPECT_TRUE(says(read(npy_of("<u4", "(1, 4)", std::vector<uint32_t>{4294967295, 4294967295, 4294967295, 40})),
                     "rows reach to voxel (4294967295, "));
    EXPECT_TRUE(says(read(npy_of("<u4", "(0, 4)", std::vector<uint32_t>{})), "has no rows"));
    const auto turned = read(npy_of("<i4", "(2, 4)", std::vector<int32_t>{0, 0, 9, 40, 1, 3, 8, 40}));
    ASSERT_TRUE(turned) << turned.error().message;
    EXPECT_NE(turned->warnings[0].find("of z y x label (OpenOccupancy) write"), std::string::npos);
    const std::string bytes = npy_of("|u1", "(1, 1, 1)", std::vector<uint8_t>{40});
    ASSERT_TRUE(read(bytes));
    for (size_t n = 0; n < bytes.size(); ++n)
        EXPECT_FALSE(read(bytes.substr(0, n))) << n;
    EXPECT_TRUE(says(detect_scene_format(folder.put("a.npz", zip_bytes({{"a.npy", bytes}, {"b.npy", bytes}}))),
                     "one array [X, Y, Z] or [N, 4] alone, found a, b"));
}

TEST(GridNpz, refuses_malformed_grids)
{
    const ScratchFolder folder;
    using Entries = std::vector<std::pair<std::string, std::string>>;
    const auto read = [&](const Entries& entries) {
        SceneGridOptions o;
        o.voxel_size = 0.6f;
        return read_grid_npz(folder.put("m.npz", zip_bytes(entries)), o);
    };
    const std::string cell = std::string("\1\0\0\0\2\0\0\0\3\0\0\0", 12);
    const std::pair<std::string, std::string> cells = {"cells.npy", npy_bytes("<i4", "(1, 3)", cell)},
                                              labels = {"labels.npy", npy_bytes("|u1", "(1,)", "\3")};
    ASSERT_TRUE(read({cells, labels})) << read({cells, labels}).error().message;
    EXPECT_TRUE(says(read({labels}), "has no array 'cells'"));
    EXPECT_TRUE(says(read({cells}), "has no array 'labels'"));
    EXPECT_TRUE(
        says(read({{"cells.npy", npy_bytes("<i4", "(3,)", cell)}, labels}), "expected shape [V, 3], found [3]"));
    EXPECT_TRUE(says(read({{"cells.npy", npy_bytes("<i4", "(3, 1)", cell)}, labels}), "expected shape [3, 3]"));
    EXPECT_TRUE(
        says(read({{"cells.npy", npy_bytes("<f4", "(1, 3)", cell)}, labels}), "cells: expected whole numbers of"));
    EXPECT_TRUE(says(read({{"cells.npy", npy_bytes("<i8", "(1, 3)", std::string(24, '\x7f'))}, labels}),
                     "cells: expected whole numbers of -2147483648 to 2147483647, found another"));
    EXPECT_TRUE(says(read({cells, {"labels.npy", npy_bytes("|i1", "(1,)", "\xff")}}),
                     "labels: expected whole numbers of 0 to"));
    EXPECT_TRUE(says(read({cells, {"labels.npy", npy_bytes("|u1", "(1,)", "\x40")}}), "unknown labels"));
    EXPECT_TRUE(says(read({cells, {"labels.npy", npy_bytes("|u1", "(2,)", "\1\2")}}), "labels: expected shape [1]"));
    EXPECT_TRUE(
        says(read({cells, labels, {"voxel_size.npy", npy_bytes("|u1", "(1,)", "\1")}}), "voxel_size: expected"));
    EXPECT_TRUE(says(read({cells, labels, {"metadata.npy", npy_bytes("|u1", "(2,)", "[]")}}), "metadata: expected an"));
    EXPECT_TRUE(
        says(read({cells, labels, {"metadata.npy", npy_bytes("|u1", "(7,)", "{\"a\":1}")}}), "expected a text"));
    const std::string six = "abcdef";
    EXPECT_TRUE(says(read({cells, labels, {"points.npy", npy_bytes("<f2", "(1, 3)", six)}}), "points: expected shape"));
    EXPECT_TRUE(says(read({cells, labels, {"points.npy", npy_bytes("<f2", "(1, 1, 3)", six)}}), "no array 'colors'"));
    EXPECT_TRUE(says(read({cells,
                           labels,
                           {"points.npy", npy_bytes("<u2", "(1, 1, 3)", six)},
                           {"colors.npy", npy_bytes("|u1", "(1, 1, 3)", "abc")}}),
                     "points: expected floats"));
    EXPECT_TRUE(
        says(read({{"cells.npy", npy_bytes("<i4", "(0, 3)", "")}, {"labels.npy", npy_bytes("|u1", "(0,)", "")}}),
             "the grid is empty"));
}

} // namespace engine_npz_test
} // namespace semrover
