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
    bool narrow = false;         // a lane of a CPU makes 8 columns, not 16: less code, and no GEGLU
};

// A tile, and how a workgroup makes it with cooperative matrices (shaders/lib/gemm_tile.coopmat.glsl). All give the
// same bits.
struct MatmulTile {
    uint32_t rows = 0, cols = 0;
    uint32_t down = 2, subgroups = 4; // one below the other, and all
    uint32_t step = 32;               // columns of K at a time: 16, 32, 64 or 128
    uint32_t stages = 1;              // of shared memory
    bool ahead = false;               // factors are loaded before those in front of them are multiplied
    uint32_t strip = 16;              // columns that a subgroup finishes at once
    uint32_t rows_of_tiles = 1;       // that workgroups go through together

    bool operator==(const MatmulTile&) const = default;
};

// what a workgroup of a variant makes that has one tile only
inline Tile fixed_tile(const KernelVariant& variant)
{
    return {variant.value("kTileM"), variant.value("kTileN")};
}

struct MatmulTiles {
    std::vector<Alternative> alternatives; // all give the same bits; the first is the fastest by a model of the device
    uint32_t col_lanes = 0;                // of a variant for CPUs: lanes side by side, pushed to the shader
};
// wanted: this tile and no other, of a variant for cooperative matrices on a device that has room for it
MatmulTiles matmul_tiles(const KernelVariant& variant, const DeviceLimits& limits, const MatmulShape& shape,
                         const MatmulTile* wanted = nullptr);
// does a device have the shared memory and the threads?
bool has_room_for(const KernelVariant& variant, const DeviceLimits& limits, const MatmulTile& tile);

// Are operations so few that code unrolled less far is better? They end sooner than a driver has read the rest of it.
bool is_little(double flops);

// what variants for cooperative matrices take from the device (shape, threads of four subgroups), and others
std::vector<ConstantValue> group_constants(const DeviceLimits& limits, std::vector<ConstantValue> others);

} // namespace semrover
