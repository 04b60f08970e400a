// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// normal and size of each point's surfel: sigma, or spacing sqrt((d1^2 + d2^2 + d3^2) / 3), d the distances of its
// nearest three points
#include "kernels/splat.h"

#include "shaders/splat/surfel.h"
#include "surfel.spv.h"

namespace semrover {

Tensor surfel(Graph& g, Tensor points, Tensor colors, Tensor neighbors, Tensor planes, const SurfelSize& size)
{
    const uint32_t rows = points.rows;
    SR_ASSERT(points.ld == 4 && colors.ld == 4 && planes.ld == 4 && colors.rows == rows && planes.rows == rows &&
                  neighbors.rows == rows,
              "surfel: {} points, {} colours, {} planes", rows, colors.rows, planes.rows);
    const SurfelPush push{.rows = rows,
                          .neighbors = neighbors.cols,
                          .sigma = size.sigma,
                          .spacing = size.spacing,
                          .smallest = size.smallest,
                          .largest = size.largest};
    const Tensor normals = g.array(rows, DType::f32, "surfel normals", 4);
    g.dispatch(kernel::surfel, {points, colors, neighbors, planes, normals}, push, threads(rows));
    return normals;
}

} // namespace semrover
