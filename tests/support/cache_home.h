// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/scratch_folder.h"

#include <cstdlib>
#include <filesystem>
#include <string>

namespace semrover {

// the cache folder of the process, for as long as a test runs
class CacheHome {
  public:
    CacheHome() { setenv("XDG_CACHE_HOME", folder_.path().c_str(), 1); }
    ~CacheHome() { before_.empty() ? unsetenv("XDG_CACHE_HOME") : setenv("XDG_CACHE_HOME", before_.c_str(), 1); }
    std::filesystem::path folder() const { return folder_ / "semrover"; } // drivers have their own
    std::filesystem::path file() const
    {
        for (const auto& entry : std::filesystem::directory_iterator(folder()))
            return entry.path();
        return {};
    }

  private:
    std::string before_ = std::getenv("XDG_CACHE_HOME") ? std::getenv("XDG_CACHE_HOME") : "";
    ScratchFolder folder_;
};

} // namespace semrover
