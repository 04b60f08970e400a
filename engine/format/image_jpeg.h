// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace semrover {

// the bytes of a file as write_jpeg_rgb8() (image.h) writes it
Result<std::vector<std::byte>> encode_jpeg_rgb8(uint32_t width, uint32_t height, std::span<const uint8_t> pixels,
                                                int quality);

} // namespace semrover
