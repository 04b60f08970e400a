// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstdint>
#include <functional>

namespace semrover {

struct FusionOptions {
    double voxel = 0.1;     // metres
    double truncation = 4;  // voxels; a pixel colours and votes within half of it
    double max_depth = 30;  // metres; pixels beyond it are not used
    double min_weight = 0;  // of a voxel, else it is unobserved; a frame adds at most 1 / (1 + z)
    uint32_t min_views = 2; // frames that saw a cell's surface, else it is dropped; at most 7
    // voxels between the distances of a cell's corners: a surface that was seen makes at most 1.8, the edge of what it
    // hides more. Where they are further apart there is no surface, for nobody saw it; what is as thin as two voxels
    // loses much of itself.
    double max_jump = 3.2;
    uint32_t excluded = 1u << 10;  // bit per class: pixels that are not used; sky
    uint32_t max_chunk_blocks = 0; // blocks of 8^3 voxels whose votes are kept at a time; 0: what memory allows
};

// called after each part of the work; an error stops it
using FusionProgress = std::function<Status(const char* stage, size_t done, size_t total)>;

} // namespace semrover
