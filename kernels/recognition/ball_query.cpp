// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the first K points i of a center's set with |p_i - c|^2 <= r^2: points [sets * N, 4], centers [sets * S, 4] ->
// [sets * S * K]
#include "kernels/recognition.h"

#include "ball_query.spv.h"

namespace semrover {

Tensor ball_query(Graph& g, Tensor points, Tensor centers, const BallOptions& o)
{
    SR_ASSERT(points.cols == 4 && points.ld == 4 && centers.cols == 4 && centers.ld == 4 && o.sets &&
                  points.rows % o.sets == 0 && centers.rows % o.sets == 0 && o.neighbors && o.radius > 0,
              "ball_query: {} points and {} centers in {} sets, {} neighbours within {}", points.rows, centers.rows,
              o.sets, o.neighbors, o.radius);
    const BallQueryPush push{.rows = centers.rows,
                             .count = points.rows / o.sets,
                             .samples = centers.rows / o.sets,
                             .neighbors = o.neighbors,
                             .radius2 = o.radius * o.radius};
    const Tensor index = g.array(centers.rows * o.neighbors, DType::u32, "group members");
    DispatchOptions dispatch;
    dispatch.max_flops = 12.0 * push.rows * push.count; // no set is full before all points were looked at
    g.dispatch(kernel::ball_query, {{"Points", points}, {"Centers", centers}, {"Index", index}}, push,
               threads(push.rows), std::move(dispatch));
    return index;
}

} // namespace semrover
