// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"

#include <cstdint>

namespace semrover {

constexpr uint32_t round_up(uint32_t value, uint32_t multiple)
{
    return (value + multiple - 1) / multiple * multiple;
}
constexpr uint64_t round_up64(uint64_t value, uint64_t multiple)
{
    return (value + multiple - 1) / multiple * multiple;
}
constexpr uint32_t divide_up(uint32_t value, uint32_t by)
{
    return (value + by - 1) / by;
}

// rows of matrices start at multiples of this many elements, so that a 16-byte texel never straddles two rows;
// kernels write zeros into the padding, because GEMM reads it
constexpr uint32_t kRowPadding = 8;

// A lazy value of a graph: a row-major matrix in one resource. Leading dimensions are folded into rows; an array is a
// matrix of one row.
struct Tensor {
    static constexpr uint32_t kNone = ~0u;

    uint32_t resource = kNone;
    DType dtype = DType::f32;
    uint32_t rows = 0;
    uint32_t cols = 0;
    uint32_t ld = 0;     // elements from one row to the next
    uint64_t offset = 0; // bytes from the start of the resource

    bool valid() const { return resource != kNone; }
    uint64_t row_bytes() const { return row_bytes_of(dtype, ld); }
    // from the first element to the end of the last row, its padding included
    uint64_t bytes() const
    {
        const uint32_t padded = round_up(cols, kRowPadding), last = padded < ld ? padded : ld;
        return rows ? (rows - 1) * row_bytes() + row_bytes_of(dtype, last) : 0;
    }

    // rows [first, first + count) of this tensor
    Tensor row_range(uint32_t first, uint32_t count) const
    {
        Tensor t = *this;
        t.rows = count;
        t.offset += first * row_bytes();
        return t;
    }
    // columns [first, first + count), not of blocks; where they start must be aligned for the device
    Tensor col_range(uint32_t first, uint32_t count) const
    {
        Tensor t = *this;
        t.cols = count;
        t.offset += uint64_t(first) * dtype_bytes(dtype);
        return t;
    }
};

} // namespace semrover
