// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "runtime/device/device.h"
#include "runtime/device/state.h"

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace semrover {

using TriangleCorners = std::array<std::array<float, 3>, 3>;
struct TreeTriangle {
    TriangleCorners corners;
    uint32_t face;
};

// boxes around boxes around triangles, as kernels/mesh.h, SurfaceTree, has them: halves by the median of centres
// along the longest axis, at most four triangles in a leaf, the left child behind its parent
struct TriangleTree {
    struct Node {
        std::array<float, 3> low;
        uint32_t link; // first triangle of a leaf, else the right child
        std::array<float, 3> high;
        uint32_t count; // triangles; 0: no leaf
    };
    std::vector<Node> nodes;
    std::vector<TreeTriangle> triangles; // in the order of leaves
};

// at least one; its face is `first_face`, the next one's one more
TriangleTree triangle_tree(const std::vector<TriangleCorners>& corners, uint32_t first_face = 0);

struct NearestFace {
    float distance; // metres, or the radius of the search
    uint32_t face;  // 2^32 - 1: none within the radius
};

// The faces of a mesh on the device, to be searched for the ones nearest to points.
class NearestSurface {
  public:
    // the mesh has passed check_mesh. Errors: out_of_memory, device_lost
    static Result<NearestSurface> create(Device& device, const Mesh& mesh);

    // the middle of the mesh in whole metres: points are relative to it, where floats are exact enough
    const std::array<double, 3>& origin() const { return origin_; }

    // exact distances; ties go to the lower face. Points: metres from the origin, unused
    Result<std::vector<NearestFace>> find(std::span<const std::array<float, 4>> points, float radius) const;

  private:
    struct Tree { // as many faces as the device can bind
        State state;
        Slot nodes, triangles;
    };

    explicit NearestSurface(Device& device) : device_(&device) {}
    Status search(std::span<const std::array<float, 4>> points, std::span<NearestFace> nearest) const;

    Device* device_;
    std::array<double, 3> origin_{};
    std::vector<Tree> trees_;
};

} // namespace semrover
