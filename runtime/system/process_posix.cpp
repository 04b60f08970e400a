// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef _WIN32
#include "runtime/system/process.h"

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <sched.h>
#include <semaphore.h>
#include <spawn.h>
#include <sstream>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char** environ;

namespace semrover::system {

namespace {

volatile std::sig_atomic_t signal_seen = 0;
sem_t arrived; // signals: what a handler may post

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

std::vector<char*> pointers_to(const std::vector<std::string>& words)
{
    std::vector<char*> pointers;
    for (const std::string& word : words)
        pointers.push_back(const_cast<char*>(word.c_str()));
    pointers.push_back(nullptr);
    return pointers;
}

} // namespace

void prepare_streams()
{
    // note: a descriptor that the caller closed would be that of the next file we open, and messages would go there.
    // Standard output is opened for reading, so that writing to it fails as it does on a closed one
    for (const auto& [fd, flags] :
         {std::pair{STDIN_FILENO, O_RDONLY}, {STDOUT_FILENO, O_RDONLY}, {STDERR_FILENO, O_WRONLY}})
        if (::fcntl(fd, F_GETFD) < 0 && errno == EBADF)
            (void)!::open("/dev/null", flags); // gets the lowest number that is free, which is fd
    // writes to a closed pipe and beyond the limit of a file's size are errors
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
}

bool standard_error_is_terminal()
{
    return ::isatty(STDERR_FILENO) != 0;
}

std::vector<std::string> arguments(int argc, char** argv)
{
    return {argv, argv + argc};
}

Path own_program()
{
    std::error_code error;
    return std::filesystem::read_symlink("/proc/self/exe", error);
}

bool on_path(const std::string& program)
{
    const char* path = std::getenv("PATH");
    std::stringstream folders(path ? path : "");
    for (std::string folder; std::getline(folders, folder, ':');)
        if (::access((Path(folder) / program).c_str(), X_OK) == 0)
            return true;
    return false;
}

HostMemory host_memory()
{
    HostMemory memory;
    std::ifstream status("/proc/self/status");
    std::string key;
    while (status >> key) {
        uint64_t kibibytes = 0;
        if (key == "VmHWM:" && status >> kibibytes)
            memory.peak = kibibytes * 1024;
        else if (key == "VmRSS:" && status >> kibibytes)
            memory.resident = kibibytes * 1024;
        status.clear();
        std::getline(status, key);
    }
    return memory;
}

void watch_stop_requests()
{
    sem_init(&arrived, 0, 0);
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    const sigset_t set = both();
    pthread_sigmask(SIG_UNBLOCK, &set, nullptr);
}

bool stop_requested()
{
    return signal_seen != 0;
}

bool wait_for_stop_request(std::optional<double> seconds)
{
    timespec until{};
    if (seconds) {
        clock_gettime(CLOCK_MONOTONIC, &until);
        const long nanoseconds = until.tv_nsec + static_cast<long>(*seconds * 1e9);
        until.tv_sec += nanoseconds / 1000000000;
        until.tv_nsec = nanoseconds % 1000000000;
    }
    while ((seconds ? sem_clockwait(&arrived, CLOCK_MONOTONIC, &until) : sem_wait(&arrived)) != 0)
        if (errno != EINTR)
            return false;
    return true;
}

void hold_stop_requests()
{
    const sigset_t set = both();
    pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

void release_stop_requests()
{
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
}

// Without the right to change priorities (another user than root), they stay so.
void give_all_threads_our_priority()
{
    const int ours = ::getpriority(PRIO_PROCESS, 0);
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
        const int thread = std::atoi(entry.path().filename().c_str());
        const sched_param none{};
        (void)::sched_setscheduler(thread, SCHED_OTHER, &none);
        (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(thread), ours);
    }
}

void exit_at_once(int code)
{
    ::_exit(code);
}

int become(const Path& program, const std::vector<std::string>& words)
{
    ::execv(program.c_str(), pointers_to(words).data());
    return errno;
}

OrError<Process> Process::start(const Path& program, const std::vector<std::string>& words, Pipe pipe)
{
    int ends[2] = {-1, -1}; // to read, to write
    if (pipe != Pipe::none && ::pipe2(ends, O_CLOEXEC) != 0)
        return tl::unexpected(errno);
    File read_end(ends[0]), write_end(ends[1]);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    if (pipe == Pipe::input)
        posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, pipe == Pipe::output ? ends[1] : STDERR_FILENO, STDOUT_FILENO);
    pid_t id = -1;
    const int error = posix_spawnp(&id, program.c_str(), &actions, nullptr, pointers_to(words).data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error)
        return tl::unexpected(error);
    Process started;
    started.id_ = id;
    started.pipe = std::move(pipe == Pipe::input ? write_end : read_end);
    return started;
}

Process::~Process()
{
    if (!id_)
        return;
    ::kill(pid_t(id_), SIGTERM);
    (void)wait();
}

void Process::kill(int64_t id)
{
    ::kill(pid_t(id), SIGKILL);
}

int Process::wait()
{
    (void)pipe.close();
    int status = 0;
    while (::waitpid(pid_t(id_), &status, 0) < 0 && errno == EINTR) {
    }
    id_ = 0; // its number may be another process's now
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

} // namespace semrover::system
#endif
