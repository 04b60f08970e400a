// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = table[index] + x: [classes, N], [M] -> [M, N]
#include "kernels/network.h"

#include "embedding.spv.h"

namespace semrover {

Tensor embedding(Graph& g, Tensor index, Tensor table, Tensor x, DType dtype, const PartOf& part)
{
    SR_ASSERT(!x.valid() || (x.rows == index.rows && x.cols == table.cols), "embedding: [{}, {}] onto [{}, {}]",
              index.rows, table.cols, x.rows, x.cols);
    const Tensor y =
        part.valid() ? part.of(index.rows, table.cols) : g.matrix(index.rows, table.cols, dtype, "embedding");
    EmbeddingPush push{};
    push.rows = index.rows;
    push.cols = table.cols;
    push.table_rows = table.rows;
    push.table_ld = table.ld;
    push.x_ld = x.ld;
    push.y_ld = y.ld;
    DispatchOptions options;
    options.banded = {"Index", "Y"};
    if (x.valid()) {
        options.constants = {{"kAddX", 1}};
        options.banded.push_back("X");
    }
    g.dispatch(kernel::embedding, {{"Index", index}, {"Table", table}, {"X", x}, {"Y", y}}, push,
               threads(index.rows * divide_up(table.cols, 8)), std::move(options));
    return y;
}

} // namespace semrover
