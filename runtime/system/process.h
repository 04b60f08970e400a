// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/system/system.h"

#include <optional>
#include <vector>

// What a program asks each operating system for; the library asks for none of it.
namespace semrover::system {

// Before anything else: the standard streams are there and carry bytes as they are, and a reader that is gone is an
// error of the write.
void prepare_streams();
bool standard_error_is_terminal();
std::vector<std::string> arguments(int argc, char** argv); // in UTF-8

Path own_program();
bool on_path(const std::string& program);

struct HostMemory {
    uint64_t resident = 0, peak = 0; // bytes; 0: unknown
};
HostMemory host_memory(); // of this process

// ---- who asks this process to stop: Ctrl-C (SIGINT), SIGTERM, a closed window

void watch_stop_requests(); // once, before there are other threads
bool stop_requested();
bool wait_for_stop_request(std::optional<double> seconds); // for one more; false: the time is over
void hold_stop_requests();    // they wait, also for the program of become(), until it watches
void release_stop_requests(); // they have their usual effect
// A process has ended when each of its threads has had time to end. Mesa's, which writes its cache of shaders, has the
// lowest priority, and on a busy machine gets that time after seconds.
void give_all_threads_our_priority();
[[noreturn]] void exit_at_once(int code);

// ---- other programs

// This process becomes that one. Returns only an errno.
int become(const Path& program, const std::vector<std::string>& words);

// A program that was started. What it prints goes to our standard error unless it is read.
class Process {
  public:
    enum class Pipe { none, input, output };
    // words[0] is its name; `program` without a folder is looked for on the PATH. ENOENT: not there
    static OrError<Process> start(const Path& program, const std::vector<std::string>& words, Pipe pipe);

    Process() = default; // none
    Process(Process&& other) noexcept : pipe(std::move(other.pipe)), id_(std::exchange(other.id_, 0)) {}
    Process& operator=(Process&&) = delete;
    ~Process(); // ends it

    int64_t id() const { return id_; }
    static void kill(int64_t id); // at once
    int wait(); // for its end: its exit code, or 128 + N when signal N ended it. Closes the pipe; once

    File pipe; // to its standard input or from its standard output

  private:
    int64_t id_ = 0; // a process or, on Windows, a handle of it
};

} // namespace semrover::system
