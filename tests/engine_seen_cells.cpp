// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/mesh/voxelizer.h"
#include "tests/support/kernel_case.h"
#include "tools/streets/street_grid.h"

#include <gtest/gtest.h>

namespace semrover {
namespace engine_seen_cells_test {

// walls across x, 6 m wide and 3 m high
Mesh walls_at(std::initializer_list<float> places)
{
    Mesh m;
    for (const float x : places) {
        const auto first = uint32_t(m.positions.size());
        for (const auto& [y, z] : {std::pair(-3.f, 0.f), {3.f, 0.f}, {3.f, 3.f}, {-3.f, 3.f}})
            m.positions.push_back({x, y, z});
        for (const uint32_t c : {1u, 2u}) {
            m.faces.push_back({first, first + c, first + c + 1});
            m.face_labels.push_back(2);
        }
    }
    return m;
}

CameraPath path_through(std::initializer_list<Point3> eyes)
{
    CameraPath path;
    for (const Point3& eye : eyes) {
        CameraFrame frame;
        frame.pose.world_to_camera = {1, 0, 0, -eye[0], 0, 1, 0, -eye[1], 0, 0, 1, -eye[2]};
        path.frames.push_back(frame);
    }
    return path;
}

class SeenCells : public testing::Test {
  protected:
    // x indices of the voxels seen, with how many there are
    std::map<int32_t, size_t> seen(const Mesh& mesh, std::initializer_list<Point3> eyes, SeenOptions options = {})
    {
        const auto voxels = voxelize(test_device(), mesh, {});
        EXPECT_TRUE(voxels);
        const CameraPath path = path_through(eyes);
        const auto cells = seen_cells(test_device(), mesh, voxels->grid, std::span(&path, 1), options);
        EXPECT_TRUE(cells);
        EXPECT_TRUE(std::ranges::is_sorted(*cells));
        std::map<int32_t, size_t> count;
        for (const uint32_t c : *cells)
            ++count[voxels->grid.cells[c][0]];
        return count;
    }
};

constexpr size_t kWall = 10 * 5; // voxels of 0.6 m

TEST_F(SeenCells, are_those_in_front_and_not_those_behind)
{
    const Mesh mesh = walls_at({3.3f, 6.3f}); // in voxels 5 and 10
    EXPECT_EQ(seen(mesh, {{0, 0, 1.5}}), (std::map<int32_t, size_t>{{5, kWall}}));
    EXPECT_EQ(seen(mesh, {{9, 0, 1.5}}), (std::map<int32_t, size_t>{{10, kWall}}));
}

TEST_F(SeenCells, of_several_poses_come_together)
{
    const Mesh mesh = walls_at({3.3f, 6.3f});
    EXPECT_EQ(seen(mesh, {{0, 0, 1.5}, {9, 0, 1.5}}), (std::map<int32_t, size_t>{{5, kWall}, {10, kWall}}));
    // a pose too near to the one before is left out
    EXPECT_EQ(seen(mesh, {{3, 0, 1.5}, {3.5, 0, 1.5}}, {.pose_spacing = 0.9}).size(), 1);
    EXPECT_EQ(seen(mesh, {{3, 0, 1.5}, {3.5, 0, 1.5}}, {.pose_spacing = 0.1}).size(), 2);
}

TEST_F(SeenCells, are_within_reach)
{
    const Mesh mesh = walls_at({3.3f});
    EXPECT_TRUE(seen(mesh, {{0, 0, 1.5}}, {.reach = 3}).empty());
    const auto near = seen(mesh, {{0, 0, 1.5}}, {.reach = 3.5});
    EXPECT_GT(near.at(5), 0);
    EXPECT_LT(near.at(5), kWall);
}

TEST_F(SeenCells, own_a_surface_that_lies_between_two_cells)
{
    const auto found = seen(walls_at({3.f}), {{0, 0, 1.5}}); // between voxels 4 and 5
    EXPECT_EQ(found.size(), 1);
    EXPECT_EQ(found.begin()->second, kWall);
}

} // namespace engine_seen_cells_test
} // namespace semrover
