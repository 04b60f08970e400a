// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

namespace semrover {

// Whether a name that comes from elsewhere names what lies in a folder when it is appended to the folder's path, links
// aside: it is not empty, has no root (on Windows neither a drive nor a leading slash), and climbs no further up than
// it went down.
bool leads_inside(std::string_view name);

// Whether what is there lies in a folder, links followed
bool lies_inside(const std::filesystem::path& folder, const std::filesystem::path& path);

} // namespace semrover
