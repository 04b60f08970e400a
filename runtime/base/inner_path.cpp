// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/inner_path.h"

#include <algorithm>

namespace semrover {

bool leads_inside(std::string_view name)
{
    if (name.empty() || name.find('\0') != name.npos)
        return false;
    const std::filesystem::path normal = std::filesystem::path(name).lexically_normal();
    return !normal.has_root_path() && *normal.begin() != "..";
}

bool lies_inside(const std::filesystem::path& folder, const std::filesystem::path& path)
{
    std::error_code error, none;
    const auto outer = std::filesystem::canonical(folder.empty() ? "." : folder, error);
    const auto inner = std::filesystem::canonical(path, none);
    return !error && !none && std::ranges::mismatch(outer, inner).in1 == outer.end();
}

} // namespace semrover
