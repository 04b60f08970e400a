// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// metres = scale / (z - offset): [pixels], [1, 2] -> [pixels]
#include "kernels/splat.h"

#include "splat_limits.spv.h"

namespace semrover {

Tensor splat_limits(Graph& g, Tensor z, Tensor scale)
{
    SR_ASSERT(z.dtype == DType::f32 && z.ld == 1 && scale.dtype == DType::f32 && scale.rows == 1 && scale.ld == 2,
              "splat_limits: [{}, {}] pixels, scale [{}, {}]", z.rows, z.ld, scale.rows, scale.ld);
    const Tensor y = g.array(z.rows, DType::f32, "limits");
    g.dispatch(kernel::splat_limits, {{"Z", z}, {"Scale", scale}, {"Limits", y}}, SplatLimitsPush{.pixels = z.rows},
               threads(z.rows));
    return y;
}

} // namespace semrover
