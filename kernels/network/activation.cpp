// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = f(x) of each element: [M, N] -> [M, N], or columns of a wider tensor
#include "kernels/network.h"

#include "activation.spv.h"

namespace semrover {

namespace {

struct Function {
    const char* name;
    const char* epilogue; // its constant in lib/gemm_epilogue.glsl
    uint32_t index;       // kFunction of activation.comp
};

Tensor activation(Graph& g, Tensor x, const Function& f, const PartOf& part = {})
{
    const uint32_t width = round_up(x.cols, kRowPadding);
    const Tensor y = part.valid() ? part.whole.row_range(part.row, x.rows) : g.matrix(x.rows, x.cols, x.dtype, f.name);
    SR_ASSERT(part.col % 8 == 0 && part.col + width <= round_up(y.cols, kRowPadding),
              "{}: [{}, {}] written into [{}, {}] from column {}", f.name, x.rows, x.cols, y.rows, y.cols, part.col);
    const ActivationPush push{.rows = x.rows, .x_ld = x.ld, .y_ld = y.ld, .y_col = part.col, .width = width};
    DispatchOptions options;
    options.constants = {{"kFunction", f.index}};
    options.epilogue = f.epilogue;
    options.banded = {"X", "Y"};
    g.dispatch(kernel::activation, {{"X", x}, {"Y", y}}, push, threads(x.rows * (width / 8)), std::move(options));
    return y;
}

} // namespace

Tensor gelu(Graph& g, Tensor x)
{
    return activation(g, x, {"gelu", "kGelu", 0});
}

Tensor silu(Graph& g, Tensor x)
{
    return activation(g, x, {"silu", "kSilu", 1});
}

Tensor relu(Graph& g, Tensor x, const PartOf& part)
{
    return activation(g, x, {"relu", "kRelu", 2}, part);
}

} // namespace semrover
