// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

namespace semrover {

// Files that belong together, whole and on the disk, but not yet under their names. Without commit() nothing is left.
class MadeFiles {
  public:
    // Its folder is made. bad_input as AtomicFile
    Status add(const Path& path, std::span<const std::byte> bytes);
    // of one file as hash_file() has it, of several a hash of theirs in the order of add()
    uint64_t hash() const;
    Status commit(); // names them, in that order; once

  private:
    std::vector<AtomicFile> files_;
    std::vector<uint64_t> hashes_;
};

// Hash of files as MadeFiles::hash() has it. bad_input: one cannot be read
Result<uint64_t> hash_files(std::span<const Path> files);

} // namespace semrover
