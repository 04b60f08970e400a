// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the nearest triangle of points and its distance, exact, through a tree of boxes
#include "kernels/mesh.h"

#include "surface_distance.spv.h"

namespace semrover {

constexpr double kOperationsPerPoint = 10000; // some hundred nodes of the tree, and triangles in the last ones

void surface_distance(Graph& g, Tensor points, const SurfaceTree& tree, Tensor y)
{
    SR_ASSERT(points.dtype == DType::f32 && points.cols >= 3 && y.rows == points.rows && tree.nodes.ld == 16 &&
                  tree.triangles.ld == 10 && y.ld == 2,
              "surface_distance: points [{}, {}], {} results", points.rows, points.cols, y.rows);
    g.dispatch(kernel::surface_distance,
               {{"Points", points}, {"Nodes", tree.nodes}, {"Triangles", tree.triangles}, {"Y", y}},
               SurfaceDistancePush{.size = points.rows, .points_ld = points.ld}, threads(points.rows),
               {.max_flops = points.rows * kOperationsPerPoint});
}

} // namespace semrover
