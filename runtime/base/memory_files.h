// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <map>
#include <memory>
#include <optional>

namespace semrover {

// Files in memory, below a folder that is on no disk, or beside the files of one that is: what reads files (file.h)
// finds them by their paths. The bytes are not copied, and stay where they are as long as the folder. Any thread.
class MemoryFolder {
  public:
    // Adds a file with a path below the folder: "unet/config.json". Errors: usage for a path that is empty or absolute,
    // leads out of the folder, or is there already
    Status add(std::string_view path, std::span<const std::byte> bytes);

    MemoryFolder();
    explicit MemoryFolder(Path path); // a folder of the disk, which has one at a time
    ~MemoryFolder();
    MemoryFolder(const MemoryFolder&) = delete;
    MemoryFolder& operator=(const MemoryFolder&) = delete;

    const Path& path() const { return path_; }

  private:
    void take_keys();

    Path path_;
    std::string first_, end_; // keys of its files: from the one to before the other
};

// for file.cpp: what such a folder has at a path
struct MemoryEntry {
    bool folder = false;
    std::span<const std::byte> bytes = {}; // of a file
};
std::optional<MemoryEntry> find_in_memory(const Path& path);
std::vector<std::string> names_in_memory(const Path& folder); // of the files below it, from it on, sorted

} // namespace semrover
