// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace semrover {

// the bytes of an archive of stored entries, by hand from PKWARE's APPNOTE
inline uint32_t crc32_of(const std::string& bytes)
{
    uint32_t crc = ~0u;
    for (const char c : bytes) {
        crc ^= static_cast<unsigned char>(c);
        for (int i = 0; i < 8; ++i)
            crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return ~crc;
}

inline void put16(std::string& out, uint32_t value)
{
    out += {static_cast<char>(value & 255), static_cast<char>((value >> 8) & 255)};
}

inline void put32(std::string& out, uint32_t value)
{
    put16(out, value & 65535);
    put16(out, value >> 16);
}

// what of an entry is the same in its local header and in the directory
inline void put_entry(std::string& out, const std::string& name, const std::string& data, uint32_t method)
{
    put16(out, 20); // version needed
    put16(out, 0);  // flags
    put16(out, method);
    put32(out, 0x00210000); // 1980-01-01
    put32(out, crc32_of(data));
    put32(out, static_cast<uint32_t>(data.size()));
    put32(out, static_cast<uint32_t>(data.size()));
    put16(out, static_cast<uint32_t>(name.size()));
    put16(out, 0); // extra
}

inline std::string zip_bytes(const std::vector<std::pair<std::string, std::string>>& entries, uint32_t method = 0)
{
    std::string out, directory;
    for (const auto& [name, data] : entries) {
        const auto offset = static_cast<uint32_t>(out.size());
        put32(out, 0x04034b50);
        put_entry(out, name, data, method);
        out += name + data;
        put32(directory, 0x02014b50);
        put16(directory, 20);
        put_entry(directory, name, data, method);
        directory += std::string(10, '\0'); // comment, disk, attributes
        put32(directory, offset);
        directory += name;
    }
    const auto begin = static_cast<uint32_t>(out.size());
    out += directory;
    put32(out, 0x06054b50);
    put32(out, 0);
    put16(out, static_cast<uint32_t>(entries.size()));
    put16(out, static_cast<uint32_t>(entries.size()));
    put32(out, static_cast<uint32_t>(directory.size()));
    put32(out, begin);
    put16(out, 0);
    return out;
}

// a .npy of version 1.0 with the header's text as it is given
inline std::string npy_bytes(const std::string& header, const std::string& data)
{
    std::string out = "\x93NUMPY\1";
    out += '\0';
    put16(out, static_cast<uint32_t>(header.size()));
    return out + header + data;
}

inline std::string npy_bytes(const std::string& descr, const std::string& shape, const std::string& data)
{
    return npy_bytes("{'descr': '" + descr + "', 'fortran_order': False, 'shape': " + shape + ", }\n", data);
}

} // namespace semrover
