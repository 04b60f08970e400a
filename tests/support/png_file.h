// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace semrover {

// PNG files of any kind, which the program does not write itself: rows as the format stores them, one after the other
struct PngFile {
    static constexpr int kGray = 0, kRgb = 2, kPalette = 3, kGrayAlpha = 4, kRgba = 6;

    uint32_t width = 0, height = 0;
    int bits = 8, kind = kGray;
    std::string rows, palette; // palette: r g b of each colour

    std::string bytes() const
    {
        std::string raw;
        const size_t row_bytes = rows.size() / height;
        for (uint32_t y = 0; y < height; ++y)
            raw += '\0' + rows.substr(y * row_bytes, row_bytes); // no filter
        std::string file = "\x89PNG\r\n\x1a\n";
        file += chunk("IHDR", word(width) + word(height) + char(bits) + char(kind) + std::string(3, '\0'));
        if (!palette.empty())
            file += chunk("PLTE", palette);
        return file + chunk("IDAT", stored(raw)) + chunk("IEND", "");
    }

  private:
    static std::string word(uint32_t v)
    {
        return {char(v >> 24), char(v >> 16 & 255), char(v >> 8 & 255), char(v & 255)};
    }
    static std::string chunk(const std::string& type, const std::string& data)
    {
        uint32_t crc = 0xffffffff;
        for (const char c : type + data) {
            crc ^= uint8_t(c);
            for (int bit = 0; bit < 8; ++bit)
                crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0u);
        }
        return word(uint32_t(data.size())) + type + data + word(~crc);
    }
    // zlib without compression
    static std::string stored(const std::string& raw)
    {
        constexpr size_t kBlock = 65535;
        std::string out = "\x78\x01";
        uint32_t a = 1, b = 0;
        for (size_t at = 0; at < raw.size(); at += kBlock) {
            const std::string block = raw.substr(at, kBlock);
            const auto size = uint16_t(block.size()), inverse = uint16_t(~size);
            out += char(at + kBlock >= raw.size());
            for (const uint16_t v : {size, inverse})
                out += {char(v & 255), char(v >> 8)};
            out += block;
        }
        for (const char c : raw) {
            a = (a + uint8_t(c)) % 65521;
            b = (b + a) % 65521;
        }
        return out + word(b << 16 | a);
    }
};

} // namespace semrover
