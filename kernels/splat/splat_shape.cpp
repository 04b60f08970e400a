// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// normal and size of each point's splat: sigma, or spacing sqrt((d1^2 + d2^2 + d3^2) / 3), d the distances of its
// nearest three points
#include "kernels/splat.h"

#include "splat_shape.spv.h"

namespace semrover {

Tensor splat_shape(Graph& g, Tensor points, Tensor colors, Tensor neighbors, Tensor planes, const SplatSize& size)
{
    const uint32_t rows = points.rows;
    SR_ASSERT(points.ld == 4 && colors.ld == 4 && planes.ld == 4 && colors.rows == rows && planes.rows == rows &&
                  neighbors.rows == rows,
              "splat: {} points, {} colours, {} planes", rows, colors.rows, planes.rows);
    const SplatShapePush push{.rows = rows,
                              .neighbors = neighbors.cols,
                              .sigma = size.sigma,
                              .spacing = size.spacing,
                              .smallest = size.smallest,
                              .largest = size.largest};
    const Tensor normals = g.array(rows, DType::f32, "splat normals", 4);
    g.dispatch(
        kernel::splat_shape,
        {{"Points", points}, {"Colors", colors}, {"Neighbors", neighbors}, {"Planes", planes}, {"Normals", normals}},
        push, threads(rows));
    return normals;
}

} // namespace semrover
