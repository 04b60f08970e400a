// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/unfinished.h"

#include <condition_variable>
#include <mutex>

namespace semrover {

namespace {

struct Registry {
    std::mutex mutex;
    std::condition_variable left; // a Together ended
    std::list<Unfinished::Entry> entries;
    size_t together = 0; // threads inside
    bool closed = false;

    // a process that is ending: whoever comes waits for that
    void wait_open(std::unique_lock<std::mutex>& lock)
    {
        left.wait(lock, [this] { return !closed; });
    }
};

Registry& registry()
{
    static auto* one = new Registry; // never destroyed: threads may write while the process ends
    return *one;
}

thread_local size_t nested = 0; // of this thread's Togethers

} // namespace

Unfinished::Unfinished(std::filesystem::path path, std::function<void()> stop)
{
    Registry& r = registry();
    std::unique_lock lock(r.mutex);
    if (nested == 0)
        r.wait_open(lock);
    entry_ = r.entries.insert(r.entries.end(), {std::move(path), std::move(stop)});
}

Unfinished::~Unfinished()
{
    Registry& r = registry();
    const std::lock_guard lock(r.mutex);
    r.entries.erase(entry_);
}

Together::Together()
{
    if (nested++ > 0)
        return;
    Registry& r = registry();
    std::unique_lock lock(r.mutex);
    r.wait_open(lock);
    ++r.together;
}

Together::~Together()
{
    if (--nested > 0)
        return;
    Registry& r = registry();
    const std::lock_guard lock(r.mutex);
    --r.together;
    r.left.notify_all();
}

void remove_unfinished()
{
    Registry& r = registry();
    std::unique_lock lock(r.mutex);
    r.closed = true;
    r.left.wait(lock, [&r] { return r.together == 0; });
    for (const Unfinished::Entry& entry : r.entries) {
        if (entry.stop)
            entry.stop();
        std::error_code ignored;
        std::filesystem::remove_all(entry.path, ignored);
    }
    lock.release(); // still locked: nothing is begun any more
}

} // namespace semrover
