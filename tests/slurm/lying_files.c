// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// A library to preload: file systems that are shared over a network, as they may be. What it lies about:
//   LYING_HIDE=FOLDER:SECONDS  what is in the folder is not found, until it is that old there (cached absence)
//   LYING_LOCKS=1              flock fails with ENOSYS (Lustre without `flock`)
//   LYING_FILE=K               the Kth rename of a file happens, and fails with ENOENT (a lost answer, a second try)
//   LYING_FOLDER=K             the same of a folder
//   LYING_WRITE=K              the Kth write to a file, and all after it, fail with ENOSPC
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static long number(const char* variable)
{
    const char* value = getenv(variable);
    return value ? atol(value) : 0;
}

static int is_hidden(const char* path)
{
    const char* hide = getenv("LYING_HIDE");
    const char* colon = hide ? strrchr(hide, ':') : NULL;
    if (!colon || strncmp(path, hide, (size_t)(colon - hide)) != 0 || path[colon - hide] != '/')
        return 0;
    char entry[4096]; // that of the folder: what is deeper came with it
    const size_t folder = (size_t)(colon - hide) + 1, length = strcspn(path + folder, "/");
    if (!length || folder + length >= sizeof entry)
        return 0;
    memcpy(entry, path, folder + length);
    entry[folder + length] = 0;
    struct stat status;
    if (syscall(SYS_newfstatat, AT_FDCWD, entry, &status, 0) != 0)
        return 0;
    return time(NULL) - status.st_ctim.tv_sec < atol(colon + 1); // renaming changes it
}

#define UNLESS_HIDDEN(path, failure)                                                                                   \
    if (is_hidden(path)) {                                                                                             \
        errno = ENOENT;                                                                                                \
        return failure;                                                                                                \
    }

int open(const char* path, int flags, ...)
{
    va_list more;
    va_start(more, flags);
    const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;
    va_end(more);
    UNLESS_HIDDEN(path, -1)
    return NEXT(open)(path, flags, mode);
}

int stat(const char* path, struct stat* status)
{
    UNLESS_HIDDEN(path, -1)
    return NEXT(stat)(path, status);
}

int lstat(const char* path, struct stat* status)
{
    UNLESS_HIDDEN(path, -1)
    return NEXT(lstat)(path, status);
}

DIR* opendir(const char* path)
{
    UNLESS_HIDDEN(path, NULL)
    return NEXT(opendir)(path);
}

int flock(int fd, int operation)
{
    if (!number("LYING_LOCKS"))
        return NEXT(flock)(fd, operation);
    errno = ENOSYS;
    return -1;
}

int rename(const char* from, const char* to)
{
    static atomic_long files, folders;
    struct stat status;
    const int folder = NEXT(stat)(from, &status) == 0 && S_ISDIR(status.st_mode);
    const int failed = NEXT(rename)(from, to);
    if (failed || (folder ? ++folders != number("LYING_FOLDER") : ++files != number("LYING_FILE")))
        return failed;
    static const char said[] = "lying_files: a rename\n";
    (void)!NEXT(write)(STDERR_FILENO, said, sizeof said - 1);
    errno = ENOENT;
    return -1;
}

ssize_t write(int fd, const void* bytes, size_t size)
{
    static atomic_long writes;
    struct stat status;
    const long full = number("LYING_WRITE");
    if (!full || fstat(fd, &status) != 0 || !S_ISREG(status.st_mode) ||
        ++writes < full)
        return NEXT(write)(fd, bytes, size);
    errno = ENOSPC;
    return -1;
}
