// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "runtime/base/dtype.h"

#include <gtest/gtest.h>

namespace semrover {

// three voxels with two points each, one of them not generated
inline VoxelGrid small_grid()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 2;
    grid.cells = {{-1, 0, 2}, {0, -5, 0}, {0, 0, 0}};
    grid.labels = {0, 19, 8};
    for (int i = 0; i < 18; ++i)
        grid.points.push_back(float_to_half(0.3f - 0.03f * static_cast<float>(i)));
    for (uint8_t i = 0; i < 18; ++i)
        grid.colors.push_back(i);
    grid.generated = {1, 0, 1};
    grid.metadata = {{"name", "small"}, {"seed", "7"}};
    return grid;
}

inline void expect_same(const VoxelGrid& a, const VoxelGrid& b)
{
    EXPECT_EQ(a.voxel_size, b.voxel_size);
    EXPECT_EQ(a.points_per_voxel, b.points_per_voxel);
    EXPECT_EQ(a.cells, b.cells);
    EXPECT_EQ(a.labels, b.labels);
    EXPECT_EQ(a.points, b.points);
    EXPECT_EQ(a.colors, b.colors);
    EXPECT_EQ(a.generated, b.generated);
    EXPECT_EQ(a.metadata, b.metadata);
}

} // namespace semrover
