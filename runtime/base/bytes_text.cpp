// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/bytes_text.h"

#include <fmt/format.h>

namespace semrover {

std::string bytes_text(uint64_t bytes)
{
    constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
    auto value = static_cast<double>(bytes);
    size_t unit = 0;
    for (; value >= 1024 && unit < 6; ++unit)
        value /= 1024;
    return fmt::format("{:.{}f} {}", value, unit > 0 && value < 100 ? 1 : 0, kUnits[unit]);
}

} // namespace semrover
