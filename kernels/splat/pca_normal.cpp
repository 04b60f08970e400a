// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// normal = eigenvector of the smallest eigenvalue of the covariance of a point's neighbours: points [P], neighbours
// [P, k] -> normals [P], eigenvalues [P]
#include "kernels/splat.h"

#include "pca_normal.spv.h"

namespace semrover {

PcaNormals pca_normal(Graph& g, Tensor points, Tensor neighbors, const PcaNormalOptions& options)
{
    const uint32_t rows = points.rows;
    const bool labelled = options.labels.valid();
    SR_ASSERT(points.dtype == DType::f32 && points.cols >= 3 && neighbors.rows == rows && neighbors.dtype == DType::u32,
              "pca_normal: points [{}, {}], neighbours [{}, {}]", rows, points.cols, neighbors.rows, neighbors.cols);
    SR_ASSERT(!labelled || options.labels.rows == rows, "pca_normal: {} labels for {} points", options.labels.rows,
              rows);
    const PcaNormalPush push{
        .rows = rows, .points_ld = points.ld, .neighbors = neighbors.cols, .line_labels = options.line_labels};
    const PcaNormals y = {g.array(rows, DType::f32, "normals", 4), g.array(rows, DType::f32, "eigenvalues", 4)};
    DispatchOptions dispatch;
    dispatch.constants = {{"kFallbacks", options.fallbacks}, {"kLabels", labelled}};
    g.dispatch(kernel::pca_normal,
               {{"Points", points},
                {"Neighbors", neighbors},
                {"Labels", options.labels},
                {"Normals", y.normals},
                {"Eigenvalues", y.eigenvalues}},
               push, threads(rows), std::move(dispatch));
    return y;
}

} // namespace semrover
