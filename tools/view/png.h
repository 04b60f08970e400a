// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

namespace semrover::view {

// r, g, b row by row from the top. The file appears whole or not at all; one that is there is replaced.
Status write_png(const Path& path, std::span<const uint8_t> rgb, uint32_t width, uint32_t height);

} // namespace semrover::view
