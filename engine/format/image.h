// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/image_size.h"
#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace semrover {

struct ImageRgb8 {
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> pixels; // [height, width, 3] sRGB
};

// PNG files, written atomically, the same pixels always as the same bytes. Pixels are [height, width(, 3)], top row
// first; another count is the caller's bug. A size of 0 or over kMaxImageSide is refused (bad_input).
constexpr int kPngLevel = 4; // of zlib, 0 to 9. 616x424 noisy colour: 46 ms against 69 at level 6, the same size
Status write_png_rgb8(const Path& path, uint32_t width, uint32_t height, std::span<const uint8_t> pixels);
Status write_png_gray8(const Path& path, uint32_t width, uint32_t height, std::span<const uint8_t> pixels);
Status write_png_gray16(const Path& path, uint32_t width, uint32_t height, std::span<const uint16_t> pixels);
// the bytes of such files
Result<std::vector<std::byte>> encode_png_rgb8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                               int level = kPngLevel);
Result<std::vector<std::byte>> encode_png_gray8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                                int level = kPngLevel);
Result<std::vector<std::byte>> encode_png_gray16(uint32_t width, uint32_t height, std::span<const uint16_t> pixels,
                                                 int level = kPngLevel);
Result<std::vector<std::byte>> encode_png_rgb16(uint32_t width, uint32_t height, std::span<const uint16_t> pixels,
                                                int level = kPngLevel);

// any PNG as 8-bit RGB: palettes and gray are expanded, 16 bits cut to 8, alpha dropped. Untrusted input: the size is
// limited, and nothing is allocated that the file is too short to fill.
Result<ImageRgb8> read_png_rgb8(const Path& path);

// baseline JPEG, 4:2:0, quality 1..100; refused like PNG. Any JPEG but those with arithmetic coding is
// read. One that is cut, or lacks pixels for another reason, is refused; so is one of more than 1024 pixels a byte
Result<std::vector<std::byte>> encode_jpeg_rgb8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                                int quality);
Result<ImageRgb8> read_jpeg_rgb8(const Path& path);

// a PNG or JPEG file in memory, told by its first bytes. `where` is its name in errors. An image of more than
// `max_pixels` is refused before they are allocated
constexpr uint64_t kMaxImagePixels = uint64_t(kMaxImageSide) * kMaxImageSide;
Result<ImageRgb8> decode_jpeg_rgb8(std::span<const std::byte> file, std::string_view where,
                                   uint64_t max_pixels = kMaxImagePixels);
Result<ImageRgb8> decode_image_rgb8(std::span<const std::byte> file, std::string_view where,
                                    uint64_t max_pixels = kMaxImagePixels);
Result<ImageRgb8> read_image_rgb8(const Path& path); // likewise, at most 1 GiB

// with alpha: [height, width], empty where all pixels are opaque. Only a PNG has any
struct ImageWithAlpha {
    ImageRgb8 color;
    std::vector<uint8_t> alpha;
};
Result<ImageWithAlpha> decode_image_with_alpha(std::span<const std::byte> file, std::string_view where,
                                               uint64_t max_pixels = kMaxImagePixels);
ImageWithAlpha split_alpha(ImageSize size, std::vector<uint8_t> rgba); // [height, width, 4]

// bad_input, with `where` in front
Status check_pixels(ImageSize size, uint64_t max_pixels, std::string_view where);

Result<ImageSize> jpeg_size(std::span<const std::byte> file, std::string_view where);
Result<ImageSize> read_image_size(const Path& path); // of a PNG or JPEG, without its pixels

// what a PNG stores
enum class PngKind { gray, gray_alpha, palette, rgb, rgba };
struct PngInfo {
    ImageSize size;
    PngKind kind = PngKind::gray;
    int bits = 8; // of a channel
};
Result<PngInfo> png_info(std::span<const std::byte> file, std::string_view where);

// The numbers that a PNG stores, as they are: 1 to 16 bits, not scaled, no palette applied
struct PngNumbers {
    PngInfo info;
    std::vector<uint16_t> values;                // [height, width]: gray, the index of a palette's colour, or red
    std::vector<bool> transparent;               // [height, width] of kinds with alpha: it is 0
    std::vector<std::array<uint8_t, 3>> palette; // sRGB
    struct Color {
        size_t pixel;
        std::array<uint16_t, 3> rgb;
    };
    std::optional<Color> color; // the first pixel, not transparent, whose channels differ
};
Result<PngNumbers> decode_png_numbers(std::span<const std::byte> file, std::string_view where,
                                      uint64_t max_pixels = kMaxImagePixels);

// 16-bit gray as it is; another kind of PNG is refused
struct ImageGray16 {
    uint32_t width = 0, height = 0;
    std::vector<uint16_t> pixels; // [height, width]
};
Result<ImageGray16> read_png_gray16(const Path& path);
// likewise three numbers of 16 bits a pixel
struct ImageRgb16 {
    uint32_t width = 0, height = 0;
    std::vector<uint16_t> pixels; // [height, width, 3]
};
Result<ImageRgb16> read_png_rgb16(const Path& path);

} // namespace semrover
