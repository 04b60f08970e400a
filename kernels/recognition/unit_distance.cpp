// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = sum over channels of w (a / (|a| + eps) - b / (|b| + eps))^2: a, b [images, H, W, C], w [1, C] ->
// y [images, H, W, 1]
#include "kernels/recognition.h"

#include "unit_distance.spv.h"

namespace semrover {

FeatureMap unit_distance(Graph& g, FeatureMap a, FeatureMap b, Tensor w, float eps)
{
    SR_ASSERT(a.batch == b.batch && a.height == b.height && a.width == b.width && a.channels() == b.channels() &&
                  w.ld == round_up(a.channels(), kRowPadding) && w.dtype == DType::f32,
              "unit_distance: {} x {}x{}x{} and {} x {}x{}x{}, {} weights", a.batch, a.height, a.width, a.channels(),
              b.batch, b.height, b.width, b.channels(), w.cols);
    const FeatureMap y = feature_map(g, a.batch, a.height, a.width, 1, DType::f32, "unit_distance");
    UnitDistancePush push{};
    push.rows = y.data.rows;
    push.a_ld = a.data.ld;
    push.b_ld = b.data.ld;
    push.y_ld = y.data.ld;
    push.width = round_up(a.channels(), kRowPadding);
    push.eps = eps;
    DispatchOptions dispatch;
    dispatch.flops = 10.0 * push.rows * push.width;
    dispatch.banded = {"A", "B", "Y"};
    g.dispatch(kernel::unit_distance, {{"A", a.data}, {"B", b.data}, {"W", w}, {"Y", y.data}}, push, threads(push.rows),
               std::move(dispatch));
    return y;
}

} // namespace semrover
