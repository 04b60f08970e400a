// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"
#include "runtime/base/made_files.h"

#include <functional>
#include <map>

namespace semrover {

// Which pieces of a run are done: those that its journal names with the hash that their files have.
class PieceRecord {
  public:
    using FilesOf = std::function<std::vector<Path>(const std::string& piece)>;

    PieceRecord(RunFolder& run, const FilesOf& files); // reads the journal, and the files that it names

    bool has(const std::string& piece) const;
    // Names its files, in the order of FilesOf, then it is in the journal, with more that is known of it.
    Status add(const std::string& piece, MadeFiles& files, const Json& more = Json::object());

  private:
    RunFolder& run_;
    std::map<std::string, bool> done_;
};

} // namespace semrover
