// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"

#include <functional>
#include <map>

namespace semrover {

// Which pieces of a run are done: those that its journal names with the hash that their files have.
class PieceRecord {
  public:
    using FilesOf = std::function<std::vector<Path>(const std::string& piece)>;

    PieceRecord(RunFolder& run, FilesOf files); // reads the journal, and the files that it names

    bool has(const std::string& piece) const;
    Status add(const std::string& piece); // its files are written

  private:
    Result<uint64_t> hash(const std::string& piece) const;

    RunFolder& run_;
    FilesOf files_;
    std::map<std::string, bool> done_;
};

} // namespace semrover
