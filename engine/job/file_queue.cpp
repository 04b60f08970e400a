// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/file_queue.h"

namespace semrover {

FileQueue::FileQueue(size_t room) : room_(room), thread_([this] { work(); }) {}

FileQueue::~FileQueue()
{
    {
        const std::scoped_lock lock(mutex_);
        closed_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

Status FileQueue::push(std::function<Status()> write)
{
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return writes_.size() < room_; });
    SR_CHECK(status_);
    writes_.push_back(std::move(write));
    changed_.notify_all();
    return {};
}

Status FileQueue::drain()
{
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return writes_.empty(); });
    return status_;
}

void FileQueue::work()
{
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return closed_ || !writes_.empty(); });
        if (writes_.empty())
            return;
        if (status_) {
            const auto& write = writes_.front(); // note: push() at the back leaves it where it is
            lock.unlock();
            Status status = write();
            lock.lock();
            status_ = std::move(status);
        }
        writes_.pop_front();
        changed_.notify_all();
    }
}

} // namespace semrover
