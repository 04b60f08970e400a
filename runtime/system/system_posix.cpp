// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef _WIN32
#include "runtime/system/system.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

namespace semrover::system {

namespace {

FileFacts facts_from(const struct stat& status)
{
    return {bool(S_ISREG(status.st_mode)), bool(S_ISDIR(status.st_mode)), uint64_t(status.st_size),
            uint64_t(status.st_dev), uint64_t(status.st_ino)};
}

int flags_of(FileUse use)
{
    // note: what others put there may be a link to any file of the user's, or a pipe that nobody writes to
    constexpr int kOwn = O_CREAT | O_NOFOLLOW | O_NONBLOCK;
    switch (use) {
    case FileUse::read:
        return O_RDONLY | O_NONBLOCK;
    case FileUse::create:
        return O_WRONLY | O_CREAT | O_EXCL;
    case FileUse::append:
        return O_WRONLY | O_APPEND | kOwn;
    case FileUse::lock:
        return O_RDWR | kOwn;
    }
    return 0;
}

} // namespace

std::string message_of(int error)
{
    return std::generic_category().message(error);
}

OrError<FileFacts> facts_of(const Path& path)
{
    if (holds_nul(path))
        return tl::unexpected(EINVAL);
    struct stat status;
    if (::stat(path.c_str(), &status) != 0)
        return tl::unexpected(errno);
    return facts_from(status);
}

OrError<File> File::open(const Path& path, FileUse use)
{
    if (holds_nul(path))
        return tl::unexpected(EINVAL);
    const int number = ::open(path.c_str(), flags_of(use) | O_CLOEXEC, 0666);
    if (number < 0)
        return tl::unexpected(errno);
    return File(number);
}

OrError<FileFacts> File::facts() const
{
    struct stat status;
    if (::fstat(number_, &status) != 0)
        return tl::unexpected(errno);
    return facts_from(status);
}

OrError<size_t> File::read(std::span<std::byte> bytes)
{
    ssize_t n;
    do
        n = ::read(number_, bytes.data(), bytes.size());
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return tl::unexpected(errno);
    return size_t(n);
}

int File::write(std::span<const std::byte> bytes)
{
    while (!bytes.empty()) {
        const ssize_t n = ::write(number_, bytes.data(), bytes.size());
        if (n < 0 && errno != EINTR)
            return errno;
        bytes = bytes.subspan(n > 0 ? size_t(n) : 0);
    }
    return 0;
}

int File::flush()
{
    return ::fsync(number_) == 0 || errno == EINVAL ? 0 : errno;
}

int File::close()
{
    return number_ < 0 || ::close(std::exchange(number_, -1)) == 0 ? 0 : errno;
}

int File::lock()
{
    return ::flock(number_, LOCK_EX | LOCK_NB) == 0 ? 0 : errno;
}

OrError<const std::byte*> File::map(uint64_t bytes) const
{
    void* data = ::mmap(nullptr, bytes, PROT_READ, MAP_PRIVATE, number_, 0);
    if (data == MAP_FAILED)
        return tl::unexpected(errno);
    return static_cast<const std::byte*>(data);
}

void unmap(const std::byte* data, uint64_t bytes)
{
    ::munmap(const_cast<std::byte*>(data), bytes);
}

// as NFS and Lustre often are mounted
bool says_no_locks(int error)
{
    return error == ENOLCK || error == ENOSYS || error == EOPNOTSUPP || error == EBADF;
}

int cut(const Path& file, uint64_t bytes)
{
    return ::truncate(file.c_str(), off_t(bytes)) == 0 ? 0 : errno;
}

int flush_folder(const Path& folder)
{
    const int number = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (number < 0)
        return errno;
    const int error = ::fsync(number) == 0 || errno == EINVAL ? 0 : errno; // a file system that cannot flush folders
    ::close(number);
    return error;
}

void remove_file(const Path& file)
{
    ::unlink(file.c_str());
}

int copy_file(const Path& from, const Path& to)
{
    std::error_code error;
    std::filesystem::copy_file(from, to, std::filesystem::copy_options::overwrite_existing, error);
    auto copy = error ? tl::unexpected(error.value()) : File::open(to, FileUse::append);
    return copy ? copy->flush() : copy.error();
}

int rename_surely(const Path& from, const Path& to)
{
    struct stat before, after;
    const bool known = ::lstat(from.c_str(), &before) == 0;
    if (::rename(from.c_str(), to.c_str()) == 0)
        return 0;
    const int error = errno;
    const bool happened =
        error == ENOENT && known && ::lstat(to.c_str(), &after) == 0 && facts_from(after).is(facts_from(before));
    return happened ? 0 : error;
}

int64_t process_number()
{
    return ::getpid();
}

bool process_is_gone(int64_t number)
{
    return ::kill(pid_t(number), 0) != 0 && errno == ESRCH;
}

std::string host_name()
{
    char name[65] = {}; // as much as Linux allows
    return ::gethostname(name, sizeof name - 1) == 0 ? name : "";
}

Path user_cache_folder()
{
    const char *cache = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
    return cache && *cache ? Path(cache) : home && *home ? Path(home) / ".cache" : Path();
}

uint32_t usable_processors()
{
    cpu_set_t set;
    return ::sched_getaffinity(0, sizeof set, &set) == 0 ? uint32_t(CPU_COUNT(&set)) : 1;
}

void close_descriptor(int descriptor)
{
    ::close(descriptor);
}

} // namespace semrover::system
#endif
