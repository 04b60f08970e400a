// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[j] = [p_i - c, f_i], i = index[j], c the center of group j / K: points [P, 4], centers [G, 4], features [P, D],
// index [G * K] -> [G * K, 3 + D]
#include "kernels/recognition.h"

#include "group_points.spv.h"

namespace semrover {

Tensor group_points(Graph& g, Tensor points, Tensor centers, Tensor features, Tensor index)
{
    SR_ASSERT(points.ld == 4 && centers.ld == 4 && features.dtype == DType::f32 && features.rows >= points.rows &&
                  index.ld == 1 && index.rows % centers.rows == 0,
              "group_points: {} points, {} centers, features [{}, {}], {} members", points.rows, centers.rows,
              features.rows, features.cols, index.rows);
    const Tensor y = g.matrix(index.rows, 3 + features.cols, DType::f32, "grouped");
    const GroupPointsPush push{.rows = index.rows,
                               .first_row = 0,
                               .neighbors = index.rows / centers.rows,
                               .features = features.cols,
                               .features_ld = features.ld,
                               .y_ld = y.ld};
    DispatchOptions dispatch;
    dispatch.banded = {"Index", "Y"};
    g.dispatch(kernel::group_points,
               {{"Points", points}, {"Centers", centers}, {"Features", features}, {"Index", index}, {"Y", y}}, push,
               threads(y.rows * (y.ld / 8)), std::move(dispatch));
    return y;
}

} // namespace semrover
