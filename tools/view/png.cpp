// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/png.h"

#include "runtime/base/quote.h"

#include <png.h>

namespace semrover::view {

Status write_png(const Path& path, std::span<const uint8_t> rgb, uint32_t width, uint32_t height)
{
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = width;
    image.height = height;
    image.format = PNG_FORMAT_RGB;
    png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(image);
    std::vector<std::byte> file(bytes);
    if (!png_image_write_to_memory(&image, file.data(), &bytes, 0, rgb.data(), 0, nullptr))
        return fail(ErrorCode::internal, "{}: libpng: {}", quote_path(path), image.message);
    return write_file_atomically(path, std::span<const std::byte>(file.data(), bytes));
}

} // namespace semrover::view
