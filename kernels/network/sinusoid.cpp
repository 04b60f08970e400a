// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = per axis [sin(x w_0), .., cos(x w_0), ..], or cosines first: [M, A], [F] -> [M, A * 2F]
#include "kernels/network.h"

#include "sinusoid.spv.h"

namespace semrover {

Tensor sinusoid(Graph& g, Tensor x, Tensor frequencies, bool cosines_lead, DType dtype)
{
    const Tensor y = g.matrix(x.rows, x.cols * 2 * frequencies.rows, dtype, "sinusoid");
    SR_ASSERT(x.ld == x.cols, "sinusoid: x is an array, its rows are not padded");
    SinusoidPush push{};
    push.rows = x.rows;
    push.axes = x.cols;
    push.frequencies = frequencies.rows;
    push.y_ld = y.ld;
    push.cosines_lead = cosines_lead;
    DispatchOptions options;
    options.banded = {"X", "Y"};
    g.dispatch(kernel::sinusoid, {{"X", x}, {"Frequencies", frequencies}, {"Y", y}}, push, threads(x.rows * (y.ld / 2)),
               std::move(options));
    return y;
}

} // namespace semrover
