// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = value
#include "kernels/sort.h"

#include "fill.spv.h"

namespace semrover {

Tensor fill(Graph& g, uint32_t size, uint32_t value)
{
    const Tensor y = g.array(size, DType::u32, "fill");
    g.dispatch(kernel::fill, {{"Y", y}}, FillPush{.size = size, .value = value}, threads(size));
    return y;
}

} // namespace semrover
