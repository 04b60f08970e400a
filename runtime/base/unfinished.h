// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <list>
#include <string>

namespace semrover {

// A file or folder that this process writes under a temporary name. A program that has to end without unwinding (the
// main thread is in a driver that compiles for minutes) removes all of them with remove_unfinished().
// Threads: any.
class Unfinished {
  public:
    // Before the file exists. `stop` is called before the file is removed: it ends who else writes to it.
    explicit Unfinished(std::filesystem::path path, std::function<void()> stop = {});
    Unfinished(const Unfinished&) = delete;
    Unfinished& operator=(const Unfinished&) = delete;
    ~Unfinished(); // the file has its final name, or is removed

    struct Entry {
        std::filesystem::path path;
        std::function<void()> stop;
    };

  private:
    std::list<Entry>::iterator entry_;
};

// The name of what is unfinished, `.semrover-HOST-PID-N.tmp`: another one at each call. Threads: any.
std::string unfinished_name();

// Whether nobody works on what has this name any more: it is of this host, and its process is gone; or it is of any
// host, and older than a day. Other names: false.
bool is_abandoned(const std::filesystem::path& path);

// remove_unfinished() waits while any of these lives: around what must happen together, such as the renames of the
// files of one result. They nest.
class Together {
  public:
    Together();
    Together(const Together&) = delete;
    Together& operator=(const Together&) = delete;
    ~Together();
};

// Removes what is unfinished. Afterwards no other thread gets past the constructors above: the process must end.
void remove_unfinished();

} // namespace semrover
