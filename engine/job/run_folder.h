// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <vector>

namespace semrover {

// folders that a run keeps in its own: pieces go when it is finished, results stay; both go when it starts over
struct RunContents {
    std::vector<std::string> pieces = {"regions"}, results;
};

// A run's folder: run.json (resolved settings, versions, device, hashes), journal.jsonl (one line per finished piece)
// and the pieces' files. A process may be killed at any time; opening the folder again gives back every piece that was
// finished. One process at a time.
class RunFolder {
  public:
    // creates the folder, or reopens it when its run.json has the same `settings`; other settings are refused unless
    // `restart`, which empties the folder first. Errors: bad_input
    static Result<RunFolder> open(const Path& folder, const Json& settings, bool restart,
                                  const RunContents& contents = {});
    RunFolder(RunFolder&& other) noexcept;
    RunFolder& operator=(RunFolder&&) = delete;
    ~RunFolder();

    const Path& path() const { return path_; }
    // lines of the journal that were there when it was opened, whole ones only, in order
    const std::vector<Json>& entries() const { return entries_; }
    bool resumed() const { return !entries_.empty(); }

    Status append(const Json& entry); // on the disk when it returns
    // run.json with `results` added; the pieces' files go
    Status finish(const Json& results);
    // after an error: a run without a single piece leaves nothing behind
    void drop_if_empty();

  private:
    RunFolder() = default;
    Status lock();
    Status read_journal();
    Status start(const Json& settings);

    Path path_;
    Json settings_;
    RunContents contents_;
    std::vector<Json> entries_;
    bool appended_ = false;
    int lock_ = -1, journal_ = -1;
};

} // namespace semrover
