// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace semrover {

constexpr uint32_t kMaxImageSide = 16384; // pixels

// a PNG's size without its pixels
struct ImageSize {
    uint32_t width = 0, height = 0;
    bool operator==(const ImageSize&) const = default;
};

} // namespace semrover
