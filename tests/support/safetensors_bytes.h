// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <fmt/format.h>
#include <initializer_list>
#include <string>
#include <string_view>

namespace semrover {

// a safetensors file of any header text and data, right or wrong
inline std::string safetensors_bytes(std::string_view header, std::string_view data = "", int64_t length = -1)
{
    const uint64_t n = length < 0 ? header.size() : static_cast<uint64_t>(length);
    std::string file;
    for (int i = 0; i < 8; ++i)
        file += static_cast<char>(n >> (8 * i));
    file += header;
    file += data;
    return file;
}

// "name":{"dtype":...,"shape":[...],"data_offsets":[...]}
inline std::string entry(std::string_view name, std::string_view dtype, std::string_view shape,
                         std::string_view offsets)
{
    return fmt::format(R"("{}":{{"dtype":"{}","shape":[{}],"data_offsets":[{}]}})", name, dtype, shape, offsets);
}

// {a,b,...}: a header of such entries
template <typename... Entries>
std::string header_of(const Entries&... entries)
{
    return fmt::format("{{{}}}", fmt::join(std::initializer_list<std::string_view>{entries...}, ","));
}

} // namespace semrover
