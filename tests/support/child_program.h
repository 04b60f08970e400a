// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csignal>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

namespace semrover {

// `semrover ARGUMENTS` (a line for the shell) running beside the test, its output thrown away
class ChildProgram {
  public:
    explicit ChildProgram(const std::string& arguments)
    {
        const std::string line = "exec " SEMROVER_BINARY " " + arguments + " </dev/null >/dev/null 2>&1";
        pid_ = fork();
        if (pid_ == 0) {
            execl("/bin/sh", "sh", "-c", line.c_str(), static_cast<char*>(nullptr));
            _exit(127);
        }
    }
    ChildProgram(const ChildProgram&) = delete;
    ChildProgram& operator=(const ChildProgram&) = delete;
    ~ChildProgram() { stop(SIGKILL); }

    bool running()
    {
        if (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_)
            pid_ = -1;
        return pid_ > 0;
    }
    void send(int signal)
    {
        if (running())
            kill(pid_, signal);
    }
    // sends the signal and waits: exit status, 128 + signal when killed
    int stop(int signal)
    {
        if (running()) {
            kill(pid_, signal);
            waitpid(pid_, &status_, 0);
            pid_ = -1;
        }
        return WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
    }

  private:
    pid_t pid_ = -1;
    int status_ = 0;
};

} // namespace semrover
