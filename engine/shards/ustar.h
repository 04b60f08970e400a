// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace semrover {

// Archives as POSIX ustar: a header, the bytes of a file, zeros up to whole blocks; two blocks of zeros end it. Time,
// owner and mode are always the same, so equal files make equal archives.
constexpr uint64_t kTarBlock = 512, kTarEnd = 2 * kTarBlock;
constexpr size_t kMostTarName = 100;                       // bytes; 155 more are for folders, which names here lack
constexpr uint64_t kMostTarFile = (uint64_t(1) << 33) - 1; // bytes: eleven octal digits

using TarHeader = std::array<char, kTarBlock>;

// of a file whose name and size are within these bounds
TarHeader tar_header(std::string_view name, uint64_t size);

// of a file's bytes in whole blocks
constexpr uint64_t tar_padded(uint64_t size)
{
    return (size + kTarBlock - 1) / kTarBlock * kTarBlock;
}

} // namespace semrover
