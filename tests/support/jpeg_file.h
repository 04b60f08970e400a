// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

inline Status write_jpeg_rgb8(const Path& path, uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                              int quality)
{
    SR_TRY(const std::vector<std::byte> file, encode_jpeg_rgb8(width, height, pixels, quality));
    return write_file_atomically(path, file);
}

} // namespace semrover
