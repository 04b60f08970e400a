// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
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
    std::string text = "\"";
    text.append(name).append("\":{\"dtype\":\"").append(dtype).append("\",\"shape\":[").append(shape);
    return text.append("],\"data_offsets\":[").append(offsets).append("]}");
}

} // namespace semrover
