// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/pass.h"

#include <vector>

// The tiles that workgroups of matrix products and convolutions make of their output: the only place that knows them.
namespace semrover {

struct MatmulShape {
    uint32_t rows = 0, cols = 0; // of the output of a group
    uint32_t groups = 1;         // workgroups in z
    std::vector<uint32_t> runs;  // columns of K that follow each other; each run begins a step of its own
};

struct MatmulTiles {
    std::vector<Alternative> alternatives; // all give the same bits; the first is the largest that fills a large GPU
    uint32_t col_lanes = 0;                // of a variant for CPUs: lanes side by side, pushed to the shader
};
// what a workgroup of a variant makes that has one tile only
inline Tile fixed_tile(const KernelVariant& variant)
{
    return {variant.value("kTileM"), variant.value("kTileN")};
}

MatmulTiles matmul_tiles(const KernelVariant& variant, const DeviceLimits& limits, const MatmulShape& shape);

// of every variant for cooperative matrices: shape of the device's, and threads of four subgroups; others have none of
// these constants; and others
std::vector<ConstantValue> matrix_constants(const DeviceLimits& limits, std::vector<ConstantValue> others);

} // namespace semrover
