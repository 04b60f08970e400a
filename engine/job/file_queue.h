// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace semrover {

// Writes files on a thread of its own, in the order in which they are handed over, while the caller makes the next
// ones. After an error nothing more is written, so what a journal names is there with all that comes before it.
class FileQueue {
  public:
    explicit FileQueue(size_t room); // writes that may wait at a time
    ~FileQueue();                    // after everything that was handed over

    // waits for room. Errors: of a write before this one
    Status push(std::function<Status()> write);
    Status drain(); // until all is written; likewise

  private:
    void work();

    size_t room_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::function<Status()>> writes_; // the first one is at work
    Status status_;
    bool closed_ = false;
    std::thread thread_; // last: it uses the others
};

} // namespace semrover
