// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/shards/ustar.h"

#include "runtime/base/result.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>

namespace semrover {

TarHeader tar_header(std::string_view name, uint64_t size)
{
    SR_ASSERT(name.size() <= kMostTarName && size <= kMostTarFile, "{} of {} bytes", name, size);
    TarHeader header{};
    const auto put = [&](size_t at, std::string_view text) { std::ranges::copy(text, header.begin() + at); };
    put(0, name);
    put(100, "0000644"); // mode
    put(108, "0000000"); // user
    put(116, "0000000"); // group
    put(124, fmt::format("{:011o}", size));
    put(136, "00000000000"); // time
    put(148, "        ");    // the sum counts itself as spaces
    put(156, "0");           // a regular file
    put(257, "ustar");
    put(263, "00");
    put(329, "0000000"); // device
    put(337, "0000000");
    const unsigned sum = std::accumulate(header.begin(), header.end(), 0u,
                                         [](unsigned total, char c) { return total + static_cast<unsigned char>(c); });
    put(148, fmt::format("{:06o}", sum));
    header[154] = '\0';
    return header;
}

} // namespace semrover
