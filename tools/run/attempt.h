// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/run/manifest.h"

#include <functional>
#include <optional>
#include <set>

namespace semrover {

// One process's try at a task, in a folder of its own that nobody else writes to: OUT/.work/KEY.HOST.PID.RANDOM. What
// it makes is published by one rename of a folder: the first of several attempts wins, the others are gone. A process
// may be killed at any time; what it had done is there for the next attempt.
class Attempt {
  public:
    // Errors: bad_input where the folder cannot be made
    static Result<Attempt> create(const Path& out, const std::string& key);
    Attempt(Attempt&& other) noexcept;
    Attempt& operator=(Attempt&&) = delete;
    ~Attempt(); // an attempt that did nothing is gone

    const Path& work() const { return work_; }   // for the run of a command, with its state
    const Path& files() const { return files_; } // for what is published
    const std::string& name() const { return name_; }

    // Takes over what an older attempt at the same task has finished: links to its files, which it may go on writing
    // beside; nothing where it ends in the meantime. Of another device's nothing is taken: `run` is the state file of
    // the command, from work() on. The one that is taken over is removed if its process is known to be gone. What was
    // not taken is said by `say`
    bool adopt(const Path& run, const std::string& device, const std::string& driver,
               const std::function<void(const std::string&)>& say);
    // an older attempt that had all its files and a manifest of this key, but was not published; false: there is none
    bool adopt_finished(const std::string& key);

    enum class Published : uint8_t { by_this, by_another };
    // files() is to have a manifest of `key`. Errors: bad_input for a folder there with another key, and where
    // renaming fails. `name`: Task::name()
    Result<Published> publish(const std::string& name, const std::string& key);

    // attempts of a job that nobody goes on with: of a key that `is_done`, older than that many seconds; what was begun
    // to be removed
    static size_t clean(const Path& out, double seconds, const std::function<bool(const std::string& key)>& is_done);
    static std::set<std::string> keys(const Path& out); // of tasks that attempts are there of

  private:
    Attempt(Path out, std::string name);
    bool take_finished(const Path& from, const std::string& key);
    std::vector<Path> older() const; // of the same key, newest first

    Path out_, folder_, work_, files_;
    std::string name_;
};

} // namespace semrover
