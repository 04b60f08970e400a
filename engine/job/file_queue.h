// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

namespace semrover {

// Makes files on threads of its own, several at a time, while the caller makes what the next ones hold; they appear in
// the order in which they were handed over. After an error nothing more appears, so what a journal names is there with
// all that comes before it.
class FileQueue {
  public:
    using Commit = std::function<Status()>;       // lets a file appear; one at a time, in order
    using Make = std::function<Result<Commit>()>; // on any thread

    // 0: usable_threads(). Where threads cannot be made, there are fewer, and without one the caller makes the files
    explicit FileQueue(uint32_t threads);
    ~FileQueue(); // after everything that was handed over

    // bytes: of host memory that `make` holds, what waits is limited by. Waits for room. Errors: of one before this
    // one; out_of_memory where making it throws std::bad_alloc
    Status push(uint64_t bytes, Make make);
    Status drain();                                 // until all has appeared; likewise
    double wait_seconds() const { return waited_; } // that the caller of both has spent in them

  private:
    struct Task {
        uint64_t bytes;
        Make make;
        std::optional<Result<Commit>> made = {};
    };
    using Lock = std::unique_lock<std::mutex>;

    void work();
    bool may_commit() const { return !committing_ && !tasks_.empty() && tasks_.front().made; }
    void make_next(Lock& lock);
    void commit_first(Lock& lock);
    template <typename F>
    void wait(Lock& lock, F until);

    size_t room_; // tasks
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Task> tasks_; // note: what is added or removed at the ends leaves the others where they are
    size_t begun_ = 0;       // of the first ones
    uint64_t bytes_ = 0;     // of all
    bool committing_ = false, closed_ = false;
    Status status_;
    double waited_ = 0;
    std::vector<std::thread> threads_; // last: they use the others
};

// CPUs that this process may use, 16 at most; $SLURM_CPUS_PER_TASK where that is fewer
uint32_t usable_threads();

} // namespace semrover
