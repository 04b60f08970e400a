// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/inner_path.h"

#include <filesystem>

namespace semrover {

bool leads_inside(std::string_view name)
{
    if (name.empty() || name.find('\0') != name.npos)
        return false;
    const std::filesystem::path normal = std::filesystem::path(name).lexically_normal();
    return !normal.has_root_path() && *normal.begin() != "..";
}

} // namespace semrover
