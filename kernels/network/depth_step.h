// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/tensor.h"

#include <initializer_list>

namespace semrover {

// Columns of K, of 128, 64 or 32, that a workgroup should have at a time where K is runs of that many columns and each
// run begins a step of its own: as many as leave an eighth of the steps empty at most.
inline uint32_t depth_step(std::initializer_list<uint32_t> runs)
{
    for (const uint32_t step : {128u, 64u}) {
        uint32_t columns = 0, padded = 0;
        for (const uint32_t run : runs) {
            columns += run;
            padded += round_up(run, step);
        }
        if (8 * uint64_t(padded) <= 9 * uint64_t(columns))
            return step;
    }
    return 32;
}

} // namespace semrover
