// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace semrover {

// an empty folder for one test, removed with all that is in it
class ScratchFolder {
  public:
    ScratchFolder();
    ScratchFolder(const ScratchFolder&) = delete;
    ScratchFolder& operator=(const ScratchFolder&) = delete;
    ~ScratchFolder();

    const std::filesystem::path& path() const { return path_; }
    std::filesystem::path operator/(std::string_view name) const { return path_ / name; }

    // writes `text` to `name` and returns its path
    std::filesystem::path put(std::string_view name, std::string_view text) const;

    // false: not on Windows, where a process needs a right to make links
    bool link(std::string_view name, const std::filesystem::path& target) const;

    size_t entries() const;

  private:
    std::filesystem::path path_;
};

std::string contents(const std::filesystem::path& path);

} // namespace semrover
