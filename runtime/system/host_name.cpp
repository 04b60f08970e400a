// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/system/host_name.h"

#include "runtime/system/system.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace semrover {

namespace {

constexpr size_t kMostLength = 64;

std::string read_host_name()
{
    const char* given = std::getenv("SEMROVER_HOST");
    std::string host = given && *given ? given : system::host_name();
    if (host.empty())
        host = "unknown";
    host.resize(std::min(host.size(), kMostLength));
    const auto unsafe = [](unsigned char c) { return !std::isalnum(c) && c != '_'; };
    std::ranges::replace_if(host, unsafe, '-');
    return host;
}

} // namespace

const std::string& host_name()
{
    static const std::string name = read_host_name();
    return name;
}

} // namespace semrover
