// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/grid.h"

#include "engine/scene/palette.h"
#include "runtime/base/dtype.h"
#include "runtime/base/safetensors.h"
#include "tests/support/grid_case.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_grid_test {

VoxelGrid semantic_grid()
{
    VoxelGrid grid = small_grid();
    grid.points.clear();
    grid.colors.clear();
    grid.generated.clear();
    return grid;
}

// writes a grid file without the checks of write_grid
Result<VoxelGrid> read_raw(const VoxelGrid& grid, const std::map<std::string, std::string>& metadata,
                           std::vector<TensorData> extra = {})
{
    const ScratchFolder folder;
    const uint64_t v = grid.cells.size(), n = static_cast<uint64_t>(grid.points_per_voxel);
    extra.push_back({"cells", DType::i32, {v, 3}, std::as_bytes(std::span(grid.cells))});
    extra.push_back({"labels", DType::u8, {grid.labels.size()}, std::as_bytes(std::span(grid.labels))});
    if (grid.has_points()) {
        extra.push_back({"points", DType::f16, {v, n, 3}, std::as_bytes(std::span(grid.points))});
        extra.push_back({"colors", DType::u8, {v, n, 3}, std::as_bytes(std::span(grid.colors))});
    }
    EXPECT_TRUE(write_safetensors(folder / "g.sgrid", extra, metadata));
    return read_grid(folder / "g.sgrid");
}

Result<VoxelGrid> read_raw(const VoxelGrid& grid)
{
    return read_raw(grid, {{"voxel_size", "0.6"}, {"points_per_voxel", "2"}});
}

TEST(Grid, a_written_grid_reads_back_the_same)
{
    const ScratchFolder folder;
    for (const VoxelGrid& grid : {small_grid(), semantic_grid()}) {
        ASSERT_TRUE(write_grid(folder / "a.sgrid", grid));
        const auto read = read_grid(folder / "a.sgrid");
        ASSERT_TRUE(read) << read.error().message;
        expect_same(*read, grid);
        ASSERT_TRUE(write_grid(folder / "b.sgrid", *read));
        EXPECT_EQ(contents(folder / "a.sgrid"), contents(folder / "b.sgrid"));
    }
}

TEST(Grid, the_streets_of_the_repository_read_and_agree)
{
    const auto semantic = read_grid(SEMROVER_SOURCE_DIR "/assets/scenes/street.semantic.sgrid");
    const auto truth = read_grid(SEMROVER_SOURCE_DIR "/assets/scenes/street.truth.sgrid");
    ASSERT_TRUE(semantic) << semantic.error().message;
    ASSERT_TRUE(truth) << truth.error().message;
    EXPECT_EQ(semantic->cells.size(), 3710u);
    EXPECT_EQ(semantic->cells, truth->cells);
    EXPECT_EQ(semantic->labels, truth->labels);
    EXPECT_EQ(truth->voxel_size, 0.6f);
    EXPECT_EQ(truth->points_per_voxel, 20);
    EXPECT_EQ(truth->points.size(), 3710u * 60);
    EXPECT_FALSE(semantic->has_points());
    EXPECT_EQ(semantic->metadata.at("name"), "street");
}

TEST(Grid, unsorted_cells_are_sorted_with_all_that_belongs_to_them)
{
    const VoxelGrid grid = small_grid();
    VoxelGrid shuffled = grid;
    const size_t order[] = {2, 0, 1};
    for (size_t i = 0; i < 3; ++i) {
        shuffled.cells[i] = grid.cells[order[i]];
        shuffled.labels[i] = grid.labels[order[i]];
        shuffled.generated[i] = grid.generated[order[i]];
        std::copy_n(grid.points.begin() + static_cast<ptrdiff_t>(order[i] * 6), 6,
                    shuffled.points.begin() + static_cast<ptrdiff_t>(i * 6));
        std::copy_n(grid.colors.begin() + static_cast<ptrdiff_t>(order[i] * 6), 6,
                    shuffled.colors.begin() + static_cast<ptrdiff_t>(i * 6));
    }
    EXPECT_TRUE(says(check_grid(shuffled, "g"), "g: voxels are not sorted: (-1, 0, 2) follows (0, 0, 0)"));
    const auto read = read_raw(shuffled);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->points, grid.points);
    sort_cells(shuffled);
    expect_same(shuffled, grid);
}

TEST(Grid, points_without_a_generated_tensor_count_as_generated)
{
    EXPECT_EQ(read_raw(small_grid())->generated, (std::vector<uint8_t>{1, 1, 1}));
}

TEST(Grid, what_is_wrong_with_a_grid_is_named)
{
    const auto broken = [](auto&& change) {
        VoxelGrid grid = small_grid();
        change(grid);
        return read_raw(grid);
    };
    EXPECT_TRUE(says(broken([](VoxelGrid& g) { g.cells[2] = g.cells[0]; }), "voxel (-1, 0, 2) is given twice"));
    EXPECT_TRUE(says(broken([](VoxelGrid& g) { g.cells[1] = {0, 1 << 21, 0}; }), "voxel (0, 2097152, 0) is absurd"));
    EXPECT_TRUE(says(broken([](VoxelGrid& g) { g.cells[0] = {-(1 << 20) - 1, 0, 0}; }), "is absurd"));
    EXPECT_TRUE(says(broken([](VoxelGrid& g) {
                         g.labels = {20, 255, 20};
                     }),
                     "unknown labels, expected 0 to 19: 20 (2 voxels), 255 (1 voxels)"));
    EXPECT_TRUE(says(broken([](VoxelGrid& g) { g.points[6 + 4] = float_to_half(0.302f); }),
                     "point 1 of voxel (0, -5, 0): y = 0.30"));
    EXPECT_TRUE(
        says(broken([](VoxelGrid& g) { g.points[0] = float_to_half(NAN); }), "point 0 of voxel (-1, 0, 2): x = nan"));
    EXPECT_TRUE(says(broken([](VoxelGrid& g) { g.points[17] = float_to_half(-INFINITY); }), "z = -inf"));
    EXPECT_TRUE(broken([](VoxelGrid& g) { g.points[0] = float_to_half(0.3009f); }));
}

TEST(Grid, an_empty_grid_is_refused_both_ways)
{
    const ScratchFolder folder;
    VoxelGrid empty;
    empty.voxel_size = 0.6f;
    EXPECT_TRUE(says(read_raw(empty), "the grid is empty"));
    EXPECT_TRUE(says(write_grid(folder / "x", empty), "the grid is empty"));
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(Grid, tensors_and_metadata_that_do_not_belong_are_refused)
{
    const VoxelGrid grid = semantic_grid();
    const std::map<std::string, std::string> good = {{"voxel_size", "0.6"}};
    const std::vector<uint8_t> octets = {1, 2, 3};
    EXPECT_TRUE(read_raw(grid, good));
    EXPECT_TRUE(says(read_raw(grid, {}), "metadata has no voxel_size"));
    EXPECT_TRUE(says(read_raw(grid, {{"voxel_size", "0.6 m"}}), "voxel_size: expected a number, found '0.6 m'"));
    EXPECT_TRUE(says(read_raw(grid, {{"voxel_size", "nan"}}), "expected a voxel size of 0.001 to 1000 m"));
    EXPECT_TRUE(says(read_raw(grid, {{"voxel_size", "-1"}}), "expected a voxel size of 0.001 to 1000 m"));
    EXPECT_TRUE(says(read_raw(small_grid(), {{"voxel_size", "0.6"}, {"points_per_voxel", "3"}}),
                     "metadata says 3 points_per_voxel, but points has 2"));
    EXPECT_TRUE(says(read_raw(grid, {{"voxel_size", "0.6"}, {"points_per_voxel", "-1"}}), "expected 0 to 4096"));
    EXPECT_TRUE(says(read_raw(grid, good, {{"normals", DType::u8, {3}, std::as_bytes(std::span(octets))}}),
                     "1 unexpected: normals [3]"));
    EXPECT_TRUE(says(read_raw(grid, good, {{"colors", DType::u8, {3, 1, 1}, std::as_bytes(std::span(octets))}}),
                     "1 missing: points"));
    VoxelGrid short_labels = grid;
    short_labels.labels.pop_back();
    EXPECT_TRUE(says(read_raw(short_labels, good), "labels expected [3] found [2]"));
}

TEST(Grid, a_cell_is_found_by_its_coordinates)
{
    const VoxelGrid grid = small_grid();
    EXPECT_EQ(find_cell(grid, {0, -5, 0}), 1u);
    EXPECT_EQ(find_cell(grid, {0, -5, 1}), std::nullopt);
    const auto center = cell_center({-1, 0, 2}, 0.6f);
    EXPECT_FLOAT_EQ(center[0], -0.3f);
    EXPECT_FLOAT_EQ(center[2], 1.5f);
}

TEST(Palette, names_and_colours_are_unique)
{
    for (size_t a = 0; a < kClassCount; ++a) {
        EXPECT_EQ(class_of_name(kPalette[a].name), a);
        for (size_t b = 0; b < a; ++b)
            EXPECT_NE(kPalette[a].color, kPalette[b].color);
    }
    EXPECT_EQ(class_of_name("moon"), std::nullopt);
}

} // namespace engine_grid_test
} // namespace semrover
