// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/renaming.h"

#include <cerrno>
#include <cstdio>
#include <sys/stat.h>

namespace semrover {

int rename_surely(const std::filesystem::path& from, const std::filesystem::path& to)
{
    struct stat before, after;
    const bool known = ::lstat(from.c_str(), &before) == 0;
    if (::rename(from.c_str(), to.c_str()) == 0)
        return 0;
    const int error = errno;
    const bool happened = error == ENOENT && known && ::lstat(to.c_str(), &after) == 0 &&
                          after.st_ino == before.st_ino && after.st_dev == before.st_dev;
    return happened ? 0 : error;
}

} // namespace semrover
