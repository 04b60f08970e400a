// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"
#include "runtime/base/result.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace semrover {

// an array of a .npy file, converted to little endian and row-major
struct NpyArray {
    DType dtype = DType::u8;
    std::vector<uint64_t> shape; // empty for a scalar
    std::vector<std::byte> data;

    uint64_t elements() const { return data.size() / dtype_bytes(dtype); }

    template <typename T>
    std::vector<T> values() const // T is the dtype's own type, or its bits
    {
        std::vector<T> out(data.size() / sizeof(T));
        std::copy_n(data.begin(), out.size() * sizeof(T), std::as_writable_bytes(std::span(out)).begin());
        return out;
    }
};

// The header of a .npy file: versions 1.0, 2.0 and 3.0; bool, integers and floats of 1 to 8 bytes of either byte order;
// up to 8 dimensions. Source: numpy.lib.format
struct NpyHeader {
    DType dtype = DType::u8;
    bool big_endian = false, fortran_order = false;
    std::vector<uint64_t> shape;
    size_t bytes = 0;        // of the header
    uint64_t data_bytes = 0; // that must follow it
};
constexpr size_t kNpyHeaderBytes = 64 << 10; // at most

// of the first bytes of a file; bad_input, with `where` in front, for anything but the above, and for data of 2^40
// bytes or more
Result<NpyHeader> parse_npy_header(std::string_view bytes, std::string_view where);

// the header's array from the bytes that follow it
NpyArray decode_npy(const NpyHeader& header, std::vector<std::byte> data);

// version 1.0, little endian, row-major
std::vector<std::byte> encode_npy(const NpyArray& array);

} // namespace semrover
