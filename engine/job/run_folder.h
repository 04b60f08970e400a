// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/device/device.h"

#include <optional>
#include <vector>

namespace semrover {

// Files and folders inside a run's folder. Pieces are removed when the run is finished, results are kept; a restart
// removes both. `numbered` are folders of results which a restart must not take for its own: of the files there it
// removes NNNNNN.png, .jpg and .npy, and points of lidars.
struct RunContents {
    std::vector<std::string> pieces = {"regions"}, results = {}, numbered = {};
};

// A run's folder: run.json (resolved settings, versions, device, hashes), journal.jsonl (one line per finished piece)
// and the pieces' files. A process may be killed at any time: the next open() finds every finished piece. One process
// at a time, by a lock; where the file system has none, a line of diagnostics.h says so once, and the caller sees to
// it. What others left there is not trusted: a link in place of one of these files or folders is refused, so that
// nothing outside the folder is read or written.
class RunFolder {
  public:
    // Creates the folder, or reopens it if its run.json has the same `settings`. With `restart` it is emptied first,
    // and so is a finished run, whose pieces are gone, unless `keep_finished`: then it is as it was, with results().
    // Errors: busy while another process has it open; bad_input, also for other settings without `restart`, and for
    // links; usage for other settings of a run that is finished
    static Result<RunFolder> open(const Path& folder, const Json& settings, bool restart,
                                  const RunContents& contents = {}, bool keep_finished = false);
    RunFolder(RunFolder&& other) noexcept = default;
    RunFolder& operator=(RunFolder&&) = delete;
    ~RunFolder();

    const Path& path() const { return path_; }
    // the journal as it was when the folder was opened: whole lines, in order
    const std::vector<Json>& entries() const { return entries_; }
    bool resumed() const { return !entries_.empty(); }
    // what finish() was given, where a run with these settings came to its end before this one was opened
    const std::optional<Json>& results() const { return results_; }

    Status append(const Json& entry); // on the disk when it returns
    // Adds `results` to run.json and removes the pieces.
    Status finish(const Json& results);
    // After an error: removes the folder's contents, and the folder if it holds nothing else, if the run has no piece
    // yet
    void drop_if_empty();

  private:
    RunFolder() = default;
    Status refuse_links() const;
    Status lock();
    Status read_journal();
    void remove_contents() const;
    Status start();
    std::vector<std::string> names() const; // of all contents

    Path path_;
    Json settings_;
    RunContents contents_;
    std::vector<Json> entries_;
    std::optional<Json> results_;
    bool appended_ = false;
    system::File lock_, journal_;
};

// What of a device decides bytes, for a run's settings: name, driver, and which kernels it gets
Json device_key(const Device& device);

} // namespace semrover
