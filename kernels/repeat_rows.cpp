// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[r] = x[r mod x_rows]: [R, N] -> [rows, N]
#include "kernels/kernels.h"

#include "repeat_rows.spv.h"
#include "shaders/repeat_rows.h"

namespace semrover {

Tensor repeat_rows(Graph& g, Tensor x, uint32_t rows, DType dtype)
{
    const Tensor y = g.matrix(rows, x.cols, dtype, "repeat_rows");
    const RepeatRowsPush push{.rows = rows, .cols = x.cols, .x_rows = x.rows, .x_ld = x.ld, .y_ld = y.ld};
    g.dispatch(kernel::repeat_rows, {x, y}, push, threads(rows * divide_up(x.cols, 8)));
    return y;
}

} // namespace semrover
