// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/scene_points.h"

#include <gtest/gtest.h>

namespace semrover {
namespace engine_scene_points_test {

ScenePoints points(std::vector<std::array<float, 3>> positions)
{
    ScenePoints p;
    for (const auto& position : positions) {
        p.colors.push_back({position[0], 0.5f, 0.25f});
        p.cells.push_back(uint32_t(p.labels.size()));
        p.labels.push_back(3);
    }
    p.positions = std::move(positions);
    return p;
}

TEST(engine_scene_points, thinned_ones_lie_at_the_mean_of_their_cube_and_have_its_mean_colour)
{
    const ScenePoints p = thinned(points({{0.1f, 0.1f, 0.1f}, {0.7f, 0.1f, 0.1f}, {0.2f, 0.3f, 0.1f}}), 0.6f);
    ASSERT_EQ(p.size(), 2u);
    const std::array<float, 3> mean{0.15f, 0.2f, 0.1f}, color{0.15f, 0.5f, 0.25f};
    for (size_t a = 0; a < 3; ++a) {
        EXPECT_NEAR(p.positions[0][a], mean[a], 1e-6);
        EXPECT_NEAR(p.colors[0][a], color[a], 1e-6);
    }
    EXPECT_EQ(p.positions[1], (std::array<float, 3>{0.7f, 0.1f, 0.1f}));
    EXPECT_EQ(p.cells, (std::vector<uint32_t>{0, 1}));
}

TEST(engine_scene_points, cubes_lie_on_one_lattice_also_below_zero)
{
    const ScenePoints p = thinned(points({{-0.1f, 0, 0}, {0.1f, 0, 0}, {-0.5f, 0, 0}}), 0.6f);
    ASSERT_EQ(p.size(), 2u);
    EXPECT_NEAR(p.positions[0][0], -0.3f, 1e-6);
    EXPECT_NEAR(p.positions[1][0], 0.1f, 1e-6);
}

TEST(engine_scene_points, labels_do_not_mix)
{
    ScenePoints p = points({{0.1f, 0, 0}, {0.2f, 0, 0}, {0.3f, 0, 0}});
    p.labels[1] = 7;
    p = thinned(p, 0.6f);
    EXPECT_EQ(p.labels, (std::vector<uint32_t>{3, 7}));
    EXPECT_NEAR(p.positions[0][0], 0.2f, 1e-6);
    EXPECT_NEAR(p.positions[1][0], 0.2f, 1e-6);
    EXPECT_EQ(thinned({}, 0.6f).size(), 0u);
}

} // namespace engine_scene_points_test
} // namespace semrover
