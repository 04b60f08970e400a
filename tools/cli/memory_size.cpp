// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/memory_size.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace semrover {

namespace {

constexpr double kGigabytesBelow = 4096; // nobody means so few bytes

// bytes of a unit; 0 for one that is not known
double unit_bytes(std::string_view unit)
{
    constexpr std::string_view kPrefixes = "kmgt";
    std::string u(unit);
    std::ranges::transform(u, u.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    if (u == "b")
        return 1;
    const size_t power = u.empty() ? std::string_view::npos : kPrefixes.find(u[0]);
    if (power == std::string_view::npos)
        return 0;
    const std::string_view rest = std::string_view(u).substr(1);
    if (rest == "ib")
        return std::pow(1024., double(power + 1));
    return rest.empty() || rest == "b" ? std::pow(1000., double(power + 1)) : 0;
}

} // namespace

Result<uint64_t> parse_memory_size(std::string_view text)
{
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    std::string_view unit = text.substr(size_t(end - text.data()));
    unit.remove_prefix(std::min(unit.find_first_not_of(' '), unit.size()));
    const double scale = unit.empty() ? (number < kGigabytesBelow ? 1e9 : 1) : unit_bytes(unit);
    if (error != std::errc() || !(number >= 0) || scale == 0 || number * scale > 1e18)
        return fail(ErrorCode::usage, "expected an amount of memory such as 6GiB, 500MB or 2.2 (GB), found {}",
                    quote(text));
    return uint64_t(std::llround(number * scale));
}

} // namespace semrover
