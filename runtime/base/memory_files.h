// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <map>
#include <memory>
#include <optional>

namespace semrover {

// Files that an application has in memory, below a folder that is on no disk: what reads files (file.h) finds them by
// their paths. The bytes are not copied, and stay where they are as long as the folder. Any thread.
class MemoryFolder {
  public:
    // Adds a file with a path below the folder: "unet/config.json". Errors: usage for a path that is empty or absolute,
    // leads out of the folder, or is there already
    Status add(std::string_view path, std::span<const std::byte> bytes);

    MemoryFolder();
    ~MemoryFolder();
    MemoryFolder(const MemoryFolder&) = delete;
    MemoryFolder& operator=(const MemoryFolder&) = delete;

    const Path& path() const { return path_; }

  private:
    Path path_;
};

// for file.cpp: what such a folder has at a path
struct MemoryEntry {
    bool folder = false;
    std::span<const std::byte> bytes = {}; // of a file
};
std::optional<MemoryEntry> find_in_memory(const Path& path);
std::vector<Path> list_in_memory(const Path& folder); // files directly in it, sorted

} // namespace semrover
