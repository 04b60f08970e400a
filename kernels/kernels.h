// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph.h"

// Every op, in pipeline order. Ops are functions on lazy values: they add dispatches to the graph and return what will
// be computed. Matrices are row-major with rows padded to kRowPadding elements; the padding is always zero. Storage is
// fp32 or fp16, arithmetic and statistics fp32.
namespace semrover {

// -- dense layers ----------------------------------------------------------------------------------------------------

// y = x w^T + bias, per group: rows [i * M, (i + 1) * M) of x meet rows [i * N, (i + 1) * N) of w
struct GemmOptions {
    uint32_t groups = 1;
    DType dtype = DType::f16; // of y
    Tensor into;              // where to write, instead of a new tensor
};
[[nodiscard]] Tensor gemm(Graph& g,
                          Tensor x,    // [groups * M, K] fp32 or fp16
                          Tensor w,    // [groups * N, K], as x
                          Tensor bias, // [groups, N] fp32, or none
                          const GemmOptions& options = {});

// y = 0.5 x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3))); runs in the epilogue of the gemm that makes x
[[nodiscard]] Tensor gelu(Graph& g, Tensor x); // [M, N] -> [M, N]

// rows of a table that modulate tokens: one row per timestep, chosen per token row
struct Modulation {
    Tensor table;      // [timesteps, width] fp32
    Tensor table_row;  // [rows] u32
    uint32_t col = 0;  // first column, for group 0
    uint32_t step = 0; // columns from one group's to the next
};

// y = residual + gate * x; runs in the epilogue of the gemm that makes x
[[nodiscard]] Tensor gated_add(Graph& g,
                               Tensor x,        // [groups * M, N]
                               Modulation gate, // N columns
                               Tensor residual, // [groups * M, N]
                               uint32_t groups = 1);

} // namespace semrover
