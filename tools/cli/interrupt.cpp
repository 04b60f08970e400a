// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/interrupt.h"

#include "runtime/base/result.h"
#include "runtime/base/unfinished.h"
#include "tools/cli/print_stderr.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <sched.h>
#include <semaphore.h>
#include <sys/resource.h>
#include <thread>
#include <time.h>
#include <unistd.h>

namespace semrover {

namespace {

volatile std::sig_atomic_t signal_seen = 0;
sem_t arrived; // signals: what a handler may post

enum class Speaker { nobody, program, watch };
std::atomic<Speaker> last_word = Speaker::nobody;

// whether the last word is this one's
bool claim(Speaker speaker)
{
    Speaker before = Speaker::nobody;
    return last_word.compare_exchange_strong(before, speaker) || before == speaker;
}

struct Message {
    std::mutex mutex;
    std::string text = "interrupted";
};

Message& message()
{
    static auto* one = new Message; // never destroyed: the thread below may read it while the process ends
    return *one;
}

void on_signal(int)
{
    const int saved = errno;
    signal_seen = 1;
    sem_post(&arrived);
    errno = saved;
}

sigset_t both()
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    return set;
}

// A process has ended when each of its threads has had time to end. Mesa's, which writes its cache of shaders, has the
// lowest priority, and on a busy machine gets that time after seconds. Without the right to change it (another user
// than root), it stays so.
void give_all_threads_our_priority()
{
    const int ours = getpriority(PRIO_PROCESS, 0);
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
        const int thread = std::atoi(entry.path().filename().c_str());
        const sched_param none{};
        (void)sched_setscheduler(thread, SCHED_OTHER, &none);
        (void)setpriority(PRIO_PROCESS, static_cast<id_t>(thread), ours);
    }
}

[[noreturn]] void end_at_once()
{
    give_all_threads_our_priority();
    remove_unfinished();
    const std::lock_guard lock(message().mutex);
    if (isatty(STDERR_FILENO))
        print_stderr("\n"); // a line of progress may be open
    print_stderr("semrover: error: {}\n", message().text);
    _exit(static_cast<int>(ErrorCode::interrupted));
}

// for one signal, then for another one or the end of the grace
void wait_for_signals()
{
    while (sem_wait(&arrived) != 0) {
    }
    timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    const long nanoseconds = until.tv_nsec + static_cast<long>(kGraceSeconds * 1e9);
    until.tv_sec += nanoseconds / 1000000000;
    until.tv_nsec = nanoseconds % 1000000000;
    while (sem_clockwait(&arrived, CLOCK_MONOTONIC, &until) != 0 && errno == EINTR) {
    }
    if (claim(Speaker::watch))
        end_at_once();
}

} // namespace

void watch_signals()
{
    sem_init(&arrived, 0, 0);
    message();
    std::thread(wait_for_signals).detach();
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    const sigset_t set = both();
    pthread_sigmask(SIG_UNBLOCK, &set, nullptr);
}

bool interrupt_requested()
{
    return signal_seen != 0;
}

void set_interrupt_message(std::string text)
{
    const std::lock_guard lock(message().mutex);
    message().text = std::move(text);
}

void claim_last_word()
{
    while (!claim(Speaker::program))
        pause();
    if (interrupt_requested())
        give_all_threads_our_priority();
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
}

void block_signals()
{
    const sigset_t set = both();
    pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

} // namespace semrover
