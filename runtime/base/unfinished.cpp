// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/unfinished.h"

#include "runtime/system/host_name.h"
#include "runtime/system/system.h"

#include <atomic>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <fmt/format.h>
#include <mutex>
#include <string_view>

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

constexpr std::string_view kBefore = ".semrover-", kAfter = ".tmp";
constexpr auto kAbandonedAfter = std::chrono::hours(24);

// of HOST-PID-N: whether it is of this host, and of no process there
bool process_is_gone(std::string_view middle)
{
    const std::string& host = host_name();
    if (!middle.starts_with(host) || middle.substr(host.size(), 1) != "-")
        return false;
    const std::string_view numbers = middle.substr(host.size() + 1);
    int32_t pid = 0;
    const auto [end, error] = std::from_chars(numbers.data(), numbers.data() + numbers.size(), pid);
    if (error != std::errc() || pid <= 0 || end == numbers.data() + numbers.size() || *end != '-')
        return false; // of a host whose name begins with this one's
    return system::process_is_gone(pid);
}

} // namespace

std::string unfinished_name()
{
    static std::atomic<unsigned> count = 0;
    return fmt::format("{}{}-{}-{}{}", kBefore, host_name(), system::process_number(), count++, kAfter);
}

bool is_abandoned(const std::filesystem::path& path)
{
    const std::string name = path.filename().string();
    if (!name.starts_with(kBefore) || !name.ends_with(kAfter) || name.size() < kBefore.size() + kAfter.size())
        return false;
    if (process_is_gone(std::string_view(name).substr(kBefore.size(), name.size() - kBefore.size() - kAfter.size())))
        return true;
    std::error_code unknown;
    const auto written = std::filesystem::last_write_time(path, unknown);
    return !unknown && std::filesystem::file_time_type::clock::now() - written > kAbandonedAfter;
}

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
