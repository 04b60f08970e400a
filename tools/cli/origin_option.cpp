// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/origin_option.h"

#include "runtime/base/quote.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>

namespace semrover {

void add_origin(CLI::App& command, std::string& text)
{
    command.add_option("--origin", text, "X,Y,Z: where the input's origin lies in the world, metres");
}

Result<std::array<double, 3>> origin_from(const std::string& text)
{
    std::array<double, 3> origin{};
    int used = 0;
    if (text.empty())
        return origin;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &origin[0], &origin[1], &origin[2], &used) != 3 ||
        size_t(used) != text.size() || !std::isfinite(origin[0] + origin[1] + origin[2]))
        return fail(ErrorCode::usage, "--origin takes X,Y,Z in metres, not {}", quote(text, 60));
    return origin;
}

} // namespace semrover
