// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// files by hand from MagicaVoxel-file-format-vox.txt and -vox-extension.txt
#include "tools/dataset/scene_readers.h"
#include "tools/dataset/vox_file.h"

#include "engine/scene/palette.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/zip_bytes.h"

#include <algorithm>
#include <random>
#include <set>

namespace semrover {
namespace engine_vox_test {

using Dictionary = std::vector<std::pair<std::string, std::string>>;

std::string u32(uint32_t value)
{
    std::string out;
    put32(out, value);
    return out;
}

std::string text(const std::string& s)
{
    return u32(static_cast<uint32_t>(s.size())) + s;
}

std::string dictionary(const Dictionary& pairs)
{
    std::string out = u32(static_cast<uint32_t>(pairs.size()));
    for (const auto& [key, value] : pairs)
        out += text(key) + text(value);
    return out;
}

std::string chunk(const std::string& id, const std::string& content)
{
    return id + u32(static_cast<uint32_t>(content.size())) + u32(0) + content;
}

std::string file(const std::string& children)
{
    return "VOX " + u32(150) + "MAIN" + u32(0) + u32(static_cast<uint32_t>(children.size())) + children;
}

std::string size(uint32_t x, uint32_t y, uint32_t z)
{
    return chunk("SIZE", u32(x) + u32(y) + u32(z));
}

// x, y, z, colour index of each
std::string voxels(const std::vector<std::array<uint8_t, 4>>& list)
{
    std::string content = u32(static_cast<uint32_t>(list.size()));
    for (const auto& v : list)
        content.append(v.begin(), v.end());
    return chunk("XYZI", content);
}

// colour index i of the class i - 1, as this program writes it; 200 is nearly road, 201 is nothing
std::string palette()
{
    std::string content(1024, '\0');
    for (size_t i = 0; i < kClassCount; ++i)
        for (size_t a = 0; a < 3; ++a)
            content[4 * i + a] = static_cast<char>(kPalette[i].color[a]);
    content.replace(4 * 199, 3, "\x81\x40\x80");
    content.replace(4 * 200, 3, "\x01\xfe\xfd");
    return chunk("RGBA", content);
}

std::string transform(uint32_t id, uint32_t child, const Dictionary& frame, const Dictionary& attributes = {},
                      uint32_t layer = 0)
{
    return chunk("nTRN",
                 u32(id) + dictionary(attributes) + u32(child) + u32(~0u) + u32(layer) + u32(1) + dictionary(frame));
}

std::string group(uint32_t id, const std::vector<uint32_t>& children)
{
    std::string content = u32(id) + dictionary({}) + u32(static_cast<uint32_t>(children.size()));
    for (const uint32_t child : children)
        content += u32(child);
    return chunk("nGRP", content);
}

std::string shape(uint32_t id, uint32_t model)
{
    return chunk("nSHP", u32(id) + dictionary({}) + u32(1) + u32(model) + dictionary({}));
}

Result<SceneGrid> read(const ScratchFolder& folder, const std::string& bytes, const SceneGridOptions& o = {})
{
    return read_vox(folder.put("t.vox", bytes), o);
}

TEST(Vox, a_model_without_a_scene_begins_at_the_origin)
{
    const ScratchFolder folder;
    const std::string bytes = file(size(3, 4, 5) + voxels({{0, 0, 0, 1}, {2, 3, 4, 20}, {1, 0, 0, 14}}) + palette());
    const auto out = read(folder, bytes);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{0, 0, 0}, {1, 0, 0}, {2, 3, 4}}));
    EXPECT_EQ(out->grid.labels, (std::vector<uint8_t>{0, 13, 19}));
    EXPECT_EQ(out->grid.voxel_size, 0.6f);
    SceneGridOptions o;
    o.voxel_size = 0.5f;
    o.origin = {-1, 0.5, 2};
    const auto moved = read(folder, bytes, o);
    ASSERT_TRUE(moved) << moved.error().message;
    EXPECT_EQ(moved->grid.cells[0], (Cell{-2, 1, 4}));
    o.origin = {0.3, 0, 0};
    EXPECT_TRUE(says(read(folder, bytes, o), "origin: 0.3 m is not a whole number of voxels of 0.5 m"));
}

TEST(Vox, transforms_place_and_turn_models)
{
    const ScratchFolder folder;
    // the description's example: rows (0 1 0), (0 0 -1), (-1 0 0) are 1 | 2 << 2 | 0 << 4 | 1 << 5 | 1 << 6
    const std::string r = std::to_string(1 | 2 << 2 | 1 << 5 | 1 << 6);
    // a bar of 3 along x, of classes 0, 1, 2, twice: as it is, and turned in a group that is moved
    const std::string bytes = file(size(3, 1, 1) + voxels({{0, 0, 0, 1}, {1, 0, 0, 2}, {2, 0, 0, 3}}) +
                                   transform(0, 1, {}) + group(1, {2, 4}) + transform(2, 3, {{"_t", "10 0 0"}}) +
                                   shape(3, 0) + transform(4, 5, {{"_t", "0 20 0"}}) + group(5, {6}) +
                                   transform(6, 7, {{"_r", r}, {"_t", "0 0 -5"}}) + shape(7, 0) + palette());
    const auto out = read(folder, bytes);
    ASSERT_TRUE(out) << out.error().message;
    // the pivot of a side of 3 is 1, of a side of 1 is 0: voxel x is cell x - 1 + 10
    std::map<Cell, uint8_t> expected = {{{9, 0, 0}, 0}, {{10, 0, 0}, 1}, {{11, 0, 0}, 2}};
    // centre from the pivot (x - 0.5, 0.5, 0.5); turned: (y, -z, -x) = (0.5, -0.5, 0.5 - x); then t = (0, 20, -5)
    for (uint8_t x = 0; x < 3; ++x)
        expected[{0, 19, -5 - x}] = x;
    EXPECT_EQ(out->grid.cells.size(), expected.size());
    for (size_t i = 0; i < out->grid.cells.size(); ++i) {
        const Cell& c = out->grid.cells[i];
        ASSERT_TRUE(expected.contains(c)) << c[0] << " " << c[1] << " " << c[2];
        EXPECT_EQ(out->grid.labels[i], expected[c]);
    }
}

TEST(Vox, all_48_turns_agree_with_matrices)
{
    std::set<std::array<int8_t, 9>> seen;
    for (int bits = 0; bits < 128; ++bits) {
        const int first = bits & 3, second = (bits >> 2) & 3;
        const std::string bytes = file(size(2, 3, 4) + voxels({{1, 2, 0, 5}}) +
                                       transform(0, 1, {{"_r", std::to_string(bits)}}) + shape(1, 0) + palette());
        const auto parsed = parse_vox(std::as_bytes(std::span(bytes.data(), bytes.size())), "here");
        if (first > 2 || second > 2 || first == second) {
            EXPECT_TRUE(says(parsed, "is no rotation"));
            continue;
        }
        ASSERT_TRUE(parsed) << parsed.error().message;
        const VoxTransform& t = parsed->nodes.at(0).transform;
        seen.insert(t.rotation);
        const double center[3] = {1.5 - 1, 2.5 - 1, 0.5 - 2}; // from the pivot
        const Cell cell = vox_cell(t, parsed->models[0], parsed->models[0].voxels[0]);
        for (size_t row = 0; row < 3; ++row) {
            double sum = 0;
            for (size_t k = 0; k < 3; ++k)
                sum += t.rotation[3 * row + k] * center[k];
            EXPECT_EQ(cell[row], std::floor(sum));
        }
    }
    EXPECT_EQ(seen.size(), 48u);
}

TEST(Vox, hidden_parts_and_covered_voxels_are_left_out)
{
    const ScratchFolder folder;
    const std::string layer = chunk("LAYR", u32(3) + dictionary({{"_hidden", "1"}}) + u32(~0u));
    const std::string bytes =
        file(size(1, 1, 1) + voxels({{0, 0, 0, 1}}) + size(1, 1, 1) + voxels({{0, 0, 0, 2}}) + transform(0, 1, {}) +
             group(1, {2, 4, 6, 8}) + transform(2, 3, {}) + shape(3, 0) + transform(4, 5, {}) + shape(5, 1) +
             transform(6, 7, {{"_t", "5 0 0"}}, {{"_hidden", "1"}}) + shape(7, 0) +
             transform(8, 9, {{"_t", "6 0 0"}}, {}, 3) + shape(9, 0) + layer + chunk("MATL", "whatever") + palette());
    const auto out = read(folder, bytes);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells, (std::vector<Cell>{{0, 0, 0}}));
    EXPECT_EQ(out->grid.labels, std::vector<uint8_t>{1}); // the later
    EXPECT_EQ(out->warnings, (std::vector<std::string>{"2 hidden nodes are left out",
                                                       "1 voxels under those of a later model are left out"}));
    EXPECT_EQ(out->dropped, 1u);
}

TEST(Vox, colours_of_no_class_need_a_map_or_the_nearest)
{
    const ScratchFolder folder;
    const std::string bytes =
        file(size(4, 1, 1) + voxels({{0, 0, 0, 200}, {1, 0, 0, 201}, {2, 0, 0, 201}, {3, 0, 0, 9}}) + palette());
    EXPECT_TRUE(says(read(folder, bytes),
                     "unknown labels: 200 #814080 (1 voxels), 201 #01fefd (2 voxels); `map` says what they are, "
                     "`nearest_color`"));
    SceneGridOptions o;
    o.nearest_color = true;
    const auto nearest = read(folder, bytes, o);
    ASSERT_TRUE(nearest) << nearest.error().message;
    EXPECT_EQ(nearest->grid.labels[0], 0);
    o = {};
    o.map = folder.put("map.json", R"({"200": "sky", "#01fefd": null})");
    const auto mapped = read(folder, bytes, o);
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(mapped->grid.labels, (std::vector<uint8_t>{10, 8}));
    EXPECT_EQ(mapped->warnings, std::vector<std::string>{"2 voxels of label 201 (#01fefd) are left out"});
}

TEST(Vox, a_grid_of_any_size_comes_back_the_same)
{
    const ScratchFolder folder;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    std::mt19937 random(3);
    std::set<Cell> cells;
    for (int i = 0; i < 3000; ++i)
        cells.insert({int32_t(random() % 900) - 500, int32_t(random() % 300) - 3, int32_t(random() % 40) - 7});
    cells.insert({-501, 400, 12}); // a block of its own
    for (const Cell& cell : cells) {
        grid.cells.push_back(cell);
        grid.labels.push_back(static_cast<uint8_t>(random() % kClassCount));
    }
    ASSERT_TRUE(write_vox(folder / "g.vox", grid));
    const auto out = read_vox(folder / "g.vox", {});
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->grid.cells, grid.cells);
    EXPECT_EQ(out->grid.labels, grid.labels);
    EXPECT_TRUE(out->warnings.empty());
    const std::string bytes = contents(folder / "g.vox");
    const auto parsed = parse_vox(std::as_bytes(std::span(bytes.data(), bytes.size())), "here");
    ASSERT_TRUE(parsed);
    EXPECT_GE(parsed->models.size(), 8u);
    for (const VoxModel& model : parsed->models)
        EXPECT_LE(*std::ranges::max_element(model.size), 256u);
}

TEST(Vox, writes_the_bytes_of_the_description)
{
    const ScratchFolder folder;
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.cells = {{-4, 7, 2}, {-3, 7, 2}};
    grid.labels = {0, 19};
    ASSERT_TRUE(write_vox(folder / "g.vox", grid));
    std::string colors(1024, '\0');
    for (size_t i = 0; i < 256; ++i) {
        for (size_t a = 0; a < 3 && i < kClassCount; ++a)
            colors[4 * i + a] = static_cast<char>(kPalette[i].color[a]);
        colors[4 * i + 3] = '\xff';
    }
    const std::string root = chunk("nTRN", u32(0) + u32(0) + u32(1) + u32(~0u) + u32(~0u) + u32(1) + u32(0));
    EXPECT_EQ(contents(folder / "g.vox"),
              file(size(2, 1, 1) + voxels({{0, 0, 0, 1}, {1, 0, 0, 20}}) + root + group(1, {2}) +
                   transform(2, 3, {{"_t", "-3 7 2"}}) + shape(3, 0) + chunk("RGBA", colors)));
}

TEST(Vox, a_file_without_a_palette_has_the_default_one)
{
    const auto palette = default_vox_palette();
    using Color = std::array<uint8_t, 3>;
    // as the description lists it, bytes in the order A B G R: 0xffccffff, 0xff00ffff, 0xffffffcc, 0xff330000, ...
    for (const auto& [index, color] : std::initializer_list<std::pair<size_t, Color>>{{0, {0, 0, 0}},
                                                                                      {1, {255, 255, 255}},
                                                                                      {2, {255, 255, 0xcc}},
                                                                                      {6, {255, 255, 0}},
                                                                                      {37, {0xcc, 255, 255}},
                                                                                      {136, {0x66, 0x33, 0x66}},
                                                                                      {215, {0, 0, 0x33}},
                                                                                      {216, {0xee, 0, 0}},
                                                                                      {225, {0x11, 0, 0}},
                                                                                      {226, {0, 0xee, 0}},
                                                                                      {236, {0, 0, 0xee}},
                                                                                      {246, {0xee, 0xee, 0xee}},
                                                                                      {255, {0x11, 0x11, 0x11}}})
        EXPECT_EQ(palette[index], color) << index;
    const ScratchFolder folder;
    const std::string model = size(2, 1, 1) + voxels({{0, 0, 0, 37}, {1, 0, 0, 216}});
    EXPECT_TRUE(says(read(folder, file(model)), "unknown labels: 37 #ccffff (1 voxels), 216 #ee0000 (1 voxels)"));
    SceneGridOptions o;
    o.nearest_color = true;
    EXPECT_EQ(read_vox(folder.put("n.vox", file(model)), o)->grid.cells.size(), 2u);
}

TEST(Vox, refuses_malformed_files)
{
    const ScratchFolder folder;
    const auto bad = [&](const std::string& children) { return read(folder, file(children)); };
    const std::string model = size(1, 1, 1) + voxels({{0, 0, 0, 1}});
    ASSERT_TRUE(bad(model + palette()));
    EXPECT_TRUE(says(read_vox(folder / "none.vox", {}), "none.vox"));
    EXPECT_TRUE(says(read(folder, ""), "4 bytes are expected, 0 are left"));
    EXPECT_TRUE(says(read(folder, "VOXI" + u32(150)), "no MagicaVoxel file: it starts with 'VOXI'"));
    EXPECT_TRUE(says(read(folder, "VOX " + u32(99)), "version 99, expected 150 to 200"));
    EXPECT_TRUE(says(read(folder, "VOX " + u32(150) + "SIZE"), "expected the chunk MAIN, found 'SIZE'"));
    EXPECT_TRUE(
        says(read(folder, "VOX " + u32(150) + "MAIN" + u32(0) + u32(9) + "12345678"), "9 bytes are expected, 8"));
    EXPECT_TRUE(says(bad(palette()), "has no models"));
    EXPECT_TRUE(says(bad(size(0, 1, 1)), "expected a size of 1 to 256, found 0"));
    EXPECT_TRUE(says(bad(size(1, 257, 1)), "found 257"));
    EXPECT_TRUE(says(bad(size(1, 1, 1) + size(1, 1, 1)), "a second SIZE"));
    EXPECT_TRUE(says(bad(size(1, 1, 1)), "a SIZE without its XYZI"));
    EXPECT_TRUE(says(bad(voxels({})), "XYZI without a SIZE"));
    EXPECT_TRUE(
        says(bad(size(1, 2, 3) + voxels({{0, 2, 0, 1}})), "voxel (0, 2, 0) of colour 1 in a model of 1 x 2 x 3"));
    EXPECT_TRUE(says(bad(size(1, 1, 1) + voxels({{0, 0, 0, 0}})), "of colour 0"));
    EXPECT_TRUE(
        says(bad(size(1, 1, 1) + chunk("XYZI", u32(0xffffffff) + "1234")), "17179869180 bytes are expected, 4"));
    EXPECT_TRUE(says(bad(chunk("RGBA", "1234")), "1024 bytes are expected, 4 are left"));
    EXPECT_TRUE(says(bad(model + palette() + transform(0, 1, {{"_r", "x"}})), "_r 'x' is no rotation"));
    EXPECT_TRUE(says(bad(model + palette() + transform(0, 1, {{"_t", "1 2"}})), "_t '1 2' is no translation"));
    EXPECT_TRUE(says(bad(model + palette() + transform(0, 1, {{"_t", "1 2 99999999"}})), "is no translation"));
    EXPECT_TRUE(says(bad(model + palette() + shape(0, 0) + shape(0, 0)), "a second node 0"));
    EXPECT_TRUE(says(bad(model + palette() + transform(0, 1, {})), "the scene has no node 1"));
    EXPECT_TRUE(says(bad(model + palette() + shape(4, 0)), "the scene has no node 0"));
    EXPECT_TRUE(says(bad(model + palette() + shape(0, 1)), "the scene names model 1, there are 1"));
    EXPECT_TRUE(says(bad(model + palette() + group(0, {0})), "deeper than 64 or has a cycle"));
    EXPECT_TRUE(says(bad(model + palette() + group(0, {})), "the scene has no voxels"));
    EXPECT_TRUE(says(bad(chunk("nTRN", u32(0) + u32(0xffffffff))), "4 bytes are expected, 0 are left"));
    EXPECT_TRUE(says(bad(chunk("nGRP", u32(0) + u32(0) + u32(0xffffffff))), "4 bytes are expected, 0 are left"));
    // two children each, thirty deep: a thousand million voxels
    std::string bomb = size(1, 1, 1) + voxels({{0, 0, 0, 1}}) + palette();
    for (uint32_t i = 0; i < 30; ++i)
        bomb += group(i, {i + 1, i + 1});
    EXPECT_TRUE(says(bad(bomb + shape(30, 0)), "deeper than 64 or has a cycle"));
}

TEST(Vox, no_prefix_of_a_file_reads_or_crashes)
{
    const ScratchFolder folder;
    const std::string bytes =
        file(size(1, 1, 1) + voxels({{0, 0, 0, 1}}) + transform(0, 1, {{"_t", "1 2 3"}}) + shape(1, 0) + palette());
    ASSERT_TRUE(read(folder, bytes));
    for (size_t n = 0; n < bytes.size(); ++n) {
        const auto part = std::as_bytes(std::span(bytes.data(), n));
        EXPECT_FALSE(parse_vox(part, "here")) << n;
    }
    // cut short within, with the sizes around it made to fit
    const std::string children = bytes.substr(20);
    for (size_t n = 0; n + 1 < children.size(); ++n)
        EXPECT_FALSE(read(folder, file(children.substr(0, n)))) << n;
}

} // namespace engine_vox_test
} // namespace semrover
