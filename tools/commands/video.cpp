// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/video.h"

#include "runtime/base/quote.h"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>
#include <vector>

extern char** environ;

namespace semrover {

namespace {

Result<pid_t> spawn_ffmpeg(const std::vector<std::string>& arguments, int input)
{
    std::vector<char*> argv;
    for (const std::string& a : arguments)
        argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    pid_t child = -1;
    const int error = posix_spawnp(&child, "ffmpeg", &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error == ENOENT)
        return fail(ErrorCode::bad_input, "--video needs ffmpeg, which is not installed (Debian: ffmpeg)");
    if (error)
        return fail(ErrorCode::bad_input, "cannot start ffmpeg: {}", std::strerror(error));
    return child;
}

} // namespace

Result<Video> Video::create(const Path& path, uint32_t width, uint32_t height, int frames_per_second)
{
    Video v;
    v.path_ = path;
    v.temporary_ = path.parent_path() / unfinished_name();
    const std::vector<std::string> arguments = {
        "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size",
        fmt::format("{}x{}", width, height), "-framerate", std::to_string(frames_per_second), "-i", "-",
        // H.264 in 4:2:0 wants even sides
        "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-f", "mp4",
        "-movflags", "+faststart", v.temporary_.string()};
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        return fail(ErrorCode::bad_input, "cannot make a pipe: {}", std::strerror(errno));
    const Together started_and_known;
    const auto child = spawn_ffmpeg(arguments, ends[0]);
    ::close(ends[0]);
    if (!child) {
        ::close(ends[1]);
        return tl::make_unexpected(child.error());
    }
    v.child_ = *child;
    v.unfinished_ = std::make_unique<Unfinished>(v.temporary_, [pid = *child] { ::kill(pid, SIGKILL); });
    v.input_ = ends[1];
    return v;
}

Video::Video(Video&& other) noexcept
    : path_(std::move(other.path_)), temporary_(std::move(other.temporary_)), child_(std::exchange(other.child_, -1)),
      input_(std::exchange(other.input_, -1)), unfinished_(std::move(other.unfinished_))
{
}

Video::~Video()
{
    if (input_ >= 0)
        ::close(input_);
    if (child_ < 0)
        return;
    ::kill(child_, SIGTERM);
    ::waitpid(child_, nullptr, 0);
    ::unlink(temporary_.c_str());
}

// note: SIGPIPE is ignored (tools/cli/program.cpp), so an ffmpeg that died is an error of write()
Status Video::add(std::span<const uint8_t> rgb)
{
    for (size_t at = 0; at < rgb.size();) {
        const ssize_t n = ::write(input_, rgb.data() + at, rgb.size() - at);
        if (n < 0 && errno != EINTR)
            return fail(ErrorCode::bad_input, "ffmpeg stopped reading frames for {}: {}", quote_path(path_),
                        std::strerror(errno));
        at += n > 0 ? size_t(n) : 0;
    }
    return {};
}

Status Video::finish()
{
    ::close(std::exchange(input_, -1));
    int status = 0;
    ::waitpid(child_, &status, 0);
    const Together renamed_and_forgotten;
    child_ = -1; // its number may be another process's now
    unfinished_.reset();
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        ::unlink(temporary_.c_str());
        return fail(ErrorCode::bad_input, "ffmpeg could not write {}", quote_path(path_));
    }
    std::error_code error;
    std::filesystem::rename(temporary_, path_, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(path_), error.message());
    return {};
}

} // namespace semrover
