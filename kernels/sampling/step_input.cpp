// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[r] = in_scale x[r mod x_rows]: [R, N] -> [rows, N]
#include "kernels/sampling.h"

#include "step_input.spv.h"

namespace semrover {

Tensor step_input(Graph& g, StepTable steps, Tensor x, uint32_t rows, DType dtype)
{
    SR_ASSERT(x.dtype == DType::f32, "step_input: the state is fp32");
    const Tensor y = g.matrix(rows, x.cols, dtype, "step_input");
    const StepInputPush push{.rows = rows, .cols = x.cols, .x_rows = x.rows, .x_ld = x.ld, .y_ld = y.ld};
    g.dispatch(kernel::step_input, {{"Clock", steps.clock}, {"Steps", steps.rows}, {"X", x}, {"Y", y}}, push,
               threads(rows * divide_up(x.cols, 8)));
    return y;
}

} // namespace semrover
