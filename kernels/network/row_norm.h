// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/tensor.h"

#include <algorithm>

namespace semrover {

// sweeps of 128 columns of a row that row_norm.simt.glsl keeps in registers. With ten a thread of fp32 rows takes about
// 110 of them; longer rows read the rest again.
constexpr uint32_t kept_sweeps(uint32_t cols)
{
    return std::min(divide_up(cols, 128), 10u);
}

} // namespace semrover
