// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
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

} // namespace semrover
