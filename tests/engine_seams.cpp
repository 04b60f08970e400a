// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/color_steps.h"

#include <gtest/gtest.h>

namespace semrover {
namespace engine_seams_test {

// a row of voxels with one colour each
VoxelGrid row(std::initializer_list<uint8_t> levels)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 2;
    int32_t i = -2;
    for (const uint8_t level : levels) {
        grid.cells.push_back({i++, 0, 0});
        grid.labels.push_back(0);
        grid.generated.push_back(1);
        grid.points.insert(grid.points.end(), 6, 0);
        for (const int off : {-4, 4}) // the mean is the level
            grid.colors.insert(grid.colors.end(), 3, uint8_t(level + off));
    }
    return grid;
}

TEST(engine_seams, steps_across_borders_and_inside_tiles_are_told_apart)
{
    const VoxelGrid grid = row({100, 110, 140, 145}); // of two tiles of two voxels
    const SeamSteps steps = seam_steps(grid, 2);
    EXPECT_EQ(steps.across.pairs, 1u);
    EXPECT_DOUBLE_EQ(steps.across.mean(), 30);
    EXPECT_EQ(steps.inside.pairs, 2u);
    EXPECT_DOUBLE_EQ(steps.inside.mean(), 7.5);
    EXPECT_DOUBLE_EQ(steps.inside.deviation(), 2.5);
}

TEST(engine_seams, cells_of_other_labels_and_those_without_points_do_not_count)
{
    VoxelGrid grid = row({100, 110, 140, 145});
    grid.labels[2] = 1;
    grid.generated[0] = 0;
    const SeamSteps steps = seam_steps(grid, 2);
    EXPECT_EQ(steps.across.pairs + steps.inside.pairs, 0u);
    EXPECT_EQ(steps.inside.mean(), 0);
}

} // namespace engine_seams_test
} // namespace semrover
