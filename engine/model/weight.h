// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"

#include <cstdint>

namespace semrover {

// A matrix of a network's parameters in an arena, rows padded. Any graph can take it as a tensor.
struct Weight {
    uint32_t slice = 0; // of the arena
    uint32_t rows = 0, cols = 0;
    DType dtype = DType::f16;
};

} // namespace semrover
