// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/file_queue.h"

#include "engine/job/budget_meter.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <new>
#include <string_view>
#include <system_error>

namespace semrover {

namespace {

constexpr uint32_t kMostThreads = 16;
constexpr size_t kRoom = 8; // tasks that wait, beside two a thread
constexpr uint64_t kMostBytes = 512ull << 20;

} // namespace

FileQueue::FileQueue(uint32_t threads)
{
    const uint32_t count = threads ? threads : usable_threads();
    room_ = kRoom + 2 * (count - 1);
    threads_.reserve(count); // from here on nothing may leave threads behind
    try {
        while (threads_.size() < count)
            threads_.emplace_back([this] { work(); });
    } catch (const std::system_error&) { // no more threads: those that are there do it, or the caller
    } catch (const std::bad_alloc&) {
    }
}

FileQueue::~FileQueue()
{
    {
        const std::scoped_lock lock(mutex_);
        closed_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_)
        thread.join();
    if (threads_.empty())
        work();
}

template <typename F>
void FileQueue::wait(Lock& lock, F until)
{
    const auto start = std::chrono::steady_clock::now();
    while (threads_.empty() && !until())
        may_commit() ? commit_first(lock) : make_next(lock);
    changed_.wait(lock, until);
    waited_ += seconds_since(start);
}

Status FileQueue::push(uint64_t bytes, Make make)
{
    Lock lock(mutex_);
    wait(lock, [&] { return tasks_.empty() || (tasks_.size() < room_ && bytes_ + bytes <= kMostBytes); });
    SR_CHECK(status_);
    tasks_.push_back({bytes, std::move(make)});
    bytes_ += bytes;
    changed_.notify_all();
    return {};
}

Status FileQueue::drain()
{
    Lock lock(mutex_);
    wait(lock, [this] { return tasks_.empty(); });
    return status_;
}

void FileQueue::work()
{
    Lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return may_commit() || begun_ < tasks_.size() || (closed_ && tasks_.empty()); });
        if (may_commit())
            commit_first(lock);
        else if (begun_ < tasks_.size())
            make_next(lock);
        else
            return;
    }
}

void FileQueue::make_next(Lock& lock)
{
    Task& task = tasks_[begun_++];
    Result<Commit> made = Commit();
    if (status_) {
        lock.unlock();
        made = unless_memory_is_short(task.make);
        task.make = {}; // with what it held
        lock.lock();
    }
    task.made = std::move(made);
    changed_.notify_all();
}

void FileQueue::commit_first(Lock& lock)
{
    committing_ = true;
    Task& task = tasks_.front();
    if (status_) {
        lock.unlock();
        Status done = *task.made ? unless_memory_is_short(**task.made) : tl::make_unexpected(task.made->error());
        lock.lock();
        status_ = std::move(done);
    }
    bytes_ -= task.bytes;
    tasks_.pop_front();
    --begun_;
    committing_ = false;
    changed_.notify_all();
}

uint32_t usable_threads()
{
    uint32_t count = system::usable_processors();
    if (const char* text = std::getenv("SLURM_CPUS_PER_TASK")) {
        const std::string_view given(text);
        uint32_t task = 0;
        std::from_chars(given.data(), given.data() + given.size(), task);
        count = task ? std::min(count, task) : count;
    }
    return std::clamp(count, 1u, kMostThreads);
}

} // namespace semrover
