// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"

#include <cstdint>

namespace semrover {

// a matrix of a network's parameters on the device, rows padded; becomes a tensor of any graph
struct Weight {
    uint32_t slice = 0; // of the arena
    uint32_t rows = 0, cols = 0;
    DType dtype = DType::f16;
};

} // namespace semrover
