// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// A library to preload: a disk that fails or lies, as disks and file systems of networks do. All but the first say what
// it is to do below FAULT_FOLDER, which has to be an absolute path:
//   FAULT_HIDE=FOLDER:SECONDS  what is in the folder is not found, until it is that old there (cached absence)
//   FAULT=KIND:N:ERRNO         the Nth call of a kind fails; N+: all from then on. ERRNO 0: it does nothing, and says
//                              that it did; -1: a write takes half of its bytes; -2: the process stops before it, and
//                              does it when it is woken (SIGCONT). With :after behind it the call happens, and then
//                              fails (a lost answer). Several, with commas between them
//   FAULT_LOG=FILE             gets a line a call, KIND PATH, of a fault FAULT KIND PATH
//   FAULT_RECORD=FILE          gets all that changes the disk, in order, for power_cuts.py
// Kinds: create (opened for writing), open, list, entry (of a listing), stat, read, write, flush, close, map, lock,
// rename (of a file), move (of a folder), mkdir, link, unlink (of folders, too), cut (to a length).
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

enum { kLongest = 4096 };

enum Kind {
    CREATE,
    OPEN,
    LIST,
    ENTRY,
    STAT,
    READ,
    WRITE,
    FLUSH,
    CLOSE,
    MAP,
    LOCK,
    RENAME,
    MOVE,
    MKDIR,
    LINK,
    UNLINK,
    CUT,
    KINDS
};
static const char* const kNames[KINDS] = {"create", "open",  "list",  "entry",  "stat", "read",
                                          "write",  "flush", "close", "map",    "lock", "rename",
                                          "move",   "mkdir", "link",  "unlink", "cut"};

// ---- paths

static int descriptor_path(int fd, char* path)
{
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t n = readlink(link, path, kLongest - 1);
    path[n > 0 ? n : 0] = 0;
    return n > 0;
}

static void path_at(int folder, const char* name, char* path)
{
    *path = 0;
    if (*name != '/' && (folder == AT_FDCWD ? getcwd(path, kLongest - 1) != NULL : descriptor_path(folder, path)))
        strcat(path, "/");
    strncat(path, name, kLongest - 1 - strlen(path));
}

static int is_ours(const char* path)
{
    const char* folder = getenv("FAULT_FOLDER");
    return folder && !strncmp(path, folder, strlen(folder)) && path[strlen(folder)] == '/';
}

static int is_folder(const char* path)
{
    struct stat status;
    return syscall(SYS_newfstatat, AT_FDCWD, path, &status, AT_SYMLINK_NOFOLLOW) == 0 && S_ISDIR(status.st_mode);
}

static int is_hidden(const char* path)
{
    const char* hide = getenv("FAULT_HIDE");
    const char* colon = hide ? strrchr(hide, ':') : NULL;
    if (!colon || strncmp(path, hide, (size_t)(colon - hide)) != 0 || path[colon - hide] != '/')
        return 0;
    char entry[kLongest]; // that of the folder: what is deeper came with it
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

// ---- what is asked for

static void append_to(const char* variable, const struct iovec* parts, int count)
{
    const char* file = getenv(variable);
    const int fd =
        file ? (int)syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666) : -1;
    if (fd >= 0) {
        (void)!syscall(SYS_writev, fd, parts, count); // at once: threads and processes do not mix
        syscall(SYS_close, fd);
    }
}

static void say(const char* fault, enum Kind kind, const char* path)
{
    char line[kLongest + 64];
    const int n = snprintf(line, sizeof line, "%s%s %s\n", fault, kNames[kind], path);
    const struct iovec part = {line, n < (int)sizeof line ? (size_t)n : sizeof line - 1};
    append_to("FAULT_LOG", &part, 1);
}

enum Verdict { HONEST, FAILS, FAILS_AFTER, LIES, HALF };

// counts a call. What becomes of it; where it fails, errno is set
static enum Verdict judge(enum Kind kind, const char* path)
{
    static atomic_long calls[KINDS];
    if (!is_ours(path))
        return HONEST;
    const int before = errno;
    const long call = ++calls[kind];
    say("", kind, path);
    for (const char* at = getenv("FAULT"); at && *at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
        char name[16], number[24];
        int error, end = 0;
        if (sscanf(at, "%15[a-z]:%23[0-9+]:%d%n", name, number, &error, &end) != 3 || strcmp(name, kNames[kind]) != 0)
            continue;
        const long wanted = atol(number);
        if (strchr(number, '+') ? call < wanted : call != wanted)
            continue;
        say("FAULT ", kind, path);
        if (error == -2) {
            raise(SIGSTOP);
            break;
        }
        errno = error;
        return error == 0 ? LIES : error < 0 ? HALF : strncmp(at + end, ":after", 6) ? FAILS : FAILS_AFTER;
    }
    errno = before;
    return HONEST;
}

static enum Verdict judge_descriptor(enum Kind kind, int fd)
{
    char path[kLongest];
    const int before = errno;
    const int known = descriptor_path(fd, path);
    errno = before;
    return known ? judge(kind, path) : HONEST;
}

// ---- the record: KIND INODE PATH OTHER NUMBER SIZE, tabs between them, then SIZE bytes

static pthread_mutex_t order = PTHREAD_MUTEX_INITIALIZER; // of what is recorded

static int records(const char* path)
{
    return getenv("FAULT_RECORD") && is_ours(path);
}

static void record(const char* kind, const char* path, const char* other, long number, const void* bytes, size_t size)
{
    const int before = errno;
    struct stat status = {0};
    syscall(SYS_newfstatat, AT_FDCWD, path, &status, AT_SYMLINK_NOFOLLOW);
    char line[2 * kLongest + 128];
    const int n =
        snprintf(line, sizeof line, "%s\t%lu\t%s\t%s\t%ld\t%zu\n", kind, status.st_ino, path, other, number, size);
    const struct iovec parts[2] = {{line, (size_t)n}, {(void*)bytes, size}};
    append_to("FAULT_RECORD", parts, 2);
    errno = before;
}

// a call that changes names, done and recorded
#define RECORDED(kind, path, other, call)                                                                              \
    ({                                                                                                                 \
        const int wanted = records(path);                                                                              \
        if (wanted)                                                                                                    \
            pthread_mutex_lock(&order);                                                                                \
        const long done = (call);                                                                                      \
        if (wanted && done >= 0)                                                                                       \
            record(kind, path, other, 0, "", 0);                                                                       \
        if (wanted)                                                                                                    \
            pthread_mutex_unlock(&order);                                                                              \
        done;                                                                                                          \
    })

static long written(int fd, const char* path, long at, long size)
{
    char* bytes = malloc(size > 0 ? (size_t)size : 1);
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const int again = (int)syscall(SYS_openat, AT_FDCWD, link, O_RDONLY | O_CLOEXEC); // fd may be for writing only
    if (again >= 0 && syscall(SYS_pread64, again, bytes, size, at) == size)
        record("write", path, "", at, bytes, (size_t)size);
    if (again >= 0)
        syscall(SYS_close, again);
    free(bytes);
    return size;
}

// a call that writes to a descriptor, done and recorded; offset -1: where it is
#define WRITTEN(fd, offset, call)                                                                                      \
    ({                                                                                                                 \
        char name[kLongest];                                                                                           \
        const int wanted = getenv("FAULT_RECORD") && descriptor_path(fd, name) && is_ours(name);                       \
        if (wanted)                                                                                                    \
            pthread_mutex_lock(&order);                                                                                \
        const long done = (call);                                                                                      \
        if (wanted && done > 0)                                                                                        \
            written(fd, name, (offset) < 0 ? lseek(fd, 0, SEEK_CUR) - done : (long)(offset), done);                    \
        if (wanted)                                                                                                    \
            pthread_mutex_unlock(&order);                                                                              \
        done;                                                                                                          \
    })

// ---- calls

#define FAULT(kind, path, failure)                                                                                     \
    const enum Verdict verdict = judge(kind, path);                                                                    \
    if (verdict == FAILS)                                                                                              \
        return failure;                                                                                                \
    const int error = errno

#define FAULT_OF(kind, fd, failure)                                                                                    \
    const enum Verdict verdict = judge_descriptor(kind, fd);                                                           \
    if (verdict == FAILS)                                                                                              \
        return failure;                                                                                                \
    const int error = errno

#define RETURN(done)                                                                                                   \
    do {                                                                                                               \
        const long result = (done);                                                                                    \
        if (verdict != FAILS_AFTER || result < 0)                                                                      \
            return result;                                                                                             \
        errno = error;                                                                                                 \
        return -1;                                                                                                     \
    } while (0)

static long open_real(int folder, const char* name, const char* path, int flags, mode_t mode)
{
    if (!(flags & (O_CREAT | O_TRUNC)) || !records(path))
        return syscall(SYS_openat, folder, name, flags, mode);
    struct stat status;
    pthread_mutex_lock(&order);
    const int absent = syscall(SYS_newfstatat, AT_FDCWD, path, &status, AT_SYMLINK_NOFOLLOW) != 0;
    const long fd = syscall(SYS_openat, folder, name, flags, mode);
    if (fd >= 0 && (absent || flags & O_TRUNC))
        record(absent ? "create" : "cut", path, "", 0, "", 0);
    pthread_mutex_unlock(&order);
    return fd;
}

static int open_any(int folder, const char* name, int flags, mode_t mode)
{
    char path[kLongest];
    path_at(folder, name, path);
    UNLESS_HIDDEN(path, -1)
    FAULT(flags & (O_CREAT | O_WRONLY | O_RDWR) ? CREATE : OPEN, path, -1);
    RETURN(open_real(folder, name, path, flags, mode));
}

static mode_t mode_of(int flags, va_list more)
{
    return flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;
}

#define OPENS(name)                                                                                                    \
    int name(const char* path, int flags, ...)                                                                         \
    {                                                                                                                  \
        va_list more;                                                                                                  \
        va_start(more, flags);                                                                                         \
        const mode_t mode = mode_of(flags, more);                                                                      \
        va_end(more);                                                                                                  \
        return open_any(AT_FDCWD, path, flags, mode);                                                                  \
    }
OPENS(open)
OPENS(open64)

int openat(int folder, const char* path, int flags, ...)
{
    va_list more;
    va_start(more, flags);
    const mode_t mode = mode_of(flags, more);
    va_end(more);
    return open_any(folder, path, flags, mode);
}

static FILE* fopen_any(const char* name, const char* mode, FILE* (*next)(const char*, const char*))
{
    char path[kLongest];
    path_at(AT_FDCWD, name, path);
    UNLESS_HIDDEN(path, NULL)
    if (judge(strpbrk(mode, "wa+") ? CREATE : OPEN, path) == FAILS)
        return NULL;
    const int absent = strpbrk(mode, "wa") && syscall(SYS_faccessat, AT_FDCWD, path, F_OK) != 0;
    FILE* file = next(name, mode);
    if (file && strpbrk(mode, "wa") && records(path))
        record(absent ? "create" : "cut", path, "", 0, "", 0);
    return file;
}

FILE* fopen(const char* path, const char* mode)
{
    return fopen_any(path, mode, NEXT(fopen));
}

FILE* fopen64(const char* path, const char* mode)
{
    return fopen_any(path, mode, NEXT(fopen64));
}

#define LOOKS(name)                                                                                                    \
    int name(const char* path, struct stat* status)                                                                    \
    {                                                                                                                  \
        char whole[kLongest];                                                                                          \
        path_at(AT_FDCWD, path, whole);                                                                                \
        UNLESS_HIDDEN(whole, -1)                                                                                       \
        FAULT(STAT, whole, -1);                                                                                        \
        RETURN(NEXT(name)(path, status));                                                                              \
    }
LOOKS(stat)
LOOKS(lstat)

DIR* opendir(const char* path)
{
    UNLESS_HIDDEN(path, NULL)
    return judge(LIST, path) == FAILS ? NULL : NEXT(opendir)(path);
}

DIR* fdopendir(int fd)
{
    return judge_descriptor(LIST, fd) == FAILS ? NULL : NEXT(fdopendir)(fd);
}

struct dirent* readdir(DIR* folder)
{
    return judge_descriptor(ENTRY, dirfd(folder)) == FAILS ? NULL : NEXT(readdir)(folder);
}

int flock(int fd, int operation)
{
    FAULT_OF(LOCK, fd, -1);
    RETURN(NEXT(flock)(fd, operation));
}

ssize_t read(int fd, void* bytes, size_t size)
{
    FAULT_OF(READ, fd, -1);
    RETURN(syscall(SYS_read, fd, bytes, verdict == HALF ? (size + 1) / 2 : size));
}

void* mmap(void* address, size_t size, int protection, int flags, int fd, off_t offset)
{
    if (fd >= 0 && judge_descriptor(MAP, fd) == FAILS)
        return MAP_FAILED;
    return (void*)syscall(SYS_mmap, address, size, protection, flags, fd, offset);
}

ssize_t write(int fd, const void* bytes, size_t size)
{
    FAULT_OF(WRITE, fd, -1);
    if (verdict == LIES)
        return (ssize_t)size;
    RETURN(WRITTEN(fd, -1, syscall(SYS_write, fd, bytes, verdict == HALF ? (size + 1) / 2 : size)));
}

ssize_t writev(int fd, const struct iovec* parts, int count)
{
    FAULT_OF(WRITE, fd, -1);
    RETURN(WRITTEN(fd, -1, syscall(SYS_writev, fd, parts, verdict == HALF ? (count + 1) / 2 : count)));
}

ssize_t sendfile(int to, int from, off_t* offset, size_t size)
{
    FAULT_OF(WRITE, to, -1);
    RETURN(WRITTEN(to, -1, syscall(SYS_sendfile, to, from, offset, verdict == HALF ? (size + 1) / 2 : size)));
}

#define FLUSHES(name, call)                                                                                            \
    int name(int fd)                                                                                                   \
    {                                                                                                                  \
        FAULT_OF(FLUSH, fd, -1);                                                                                       \
        char path[kLongest];                                                                                           \
        descriptor_path(fd, path);                                                                                     \
        if (verdict == LIES)                                                                                           \
            return 0;                                                                                                  \
        RETURN(RECORDED("flush", path, "", syscall(call, fd)));                                                        \
    }
FLUSHES(fsync, SYS_fsync)
FLUSHES(fdatasync, SYS_fdatasync)

int close(int fd)
{
    FAULT_OF(CLOSE, fd, (syscall(SYS_close, fd), -1)); // it is closed whatever it says
    RETURN(syscall(SYS_close, fd));
}

int rename(const char* from, const char* to)
{
    char path[kLongest], other[kLongest];
    path_at(AT_FDCWD, from, path);
    path_at(AT_FDCWD, to, other);
    FAULT(is_folder(path) ? MOVE : RENAME, path, -1);
    RETURN(RECORDED("rename", path, other, syscall(SYS_rename, from, to)));
}

int mkdir(const char* name, mode_t mode)
{
    char path[kLongest];
    path_at(AT_FDCWD, name, path);
    FAULT(MKDIR, path, -1);
    RETURN(RECORDED("mkdir", path, "", syscall(SYS_mkdir, name, mode)));
}

int link(const char* from, const char* to)
{
    char path[kLongest], other[kLongest];
    path_at(AT_FDCWD, from, path);
    path_at(AT_FDCWD, to, other);
    FAULT(LINK, other, -1);
    RETURN(RECORDED("link", path, other, syscall(SYS_link, from, to)));
}

static int unlink_any(int folder, const char* name, int flags)
{
    char path[kLongest];
    path_at(folder, name, path);
    FAULT(UNLINK, path, -1);
    RETURN(RECORDED("unlink", path, "", syscall(SYS_unlinkat, folder, name, flags)));
}

int unlink(const char* path)
{
    return unlink_any(AT_FDCWD, path, 0);
}

int unlinkat(int folder, const char* path, int flags)
{
    return unlink_any(folder, path, flags);
}

int rmdir(const char* path)
{
    return unlink_any(AT_FDCWD, path, AT_REMOVEDIR);
}

int remove(const char* path)
{
    return unlink_any(AT_FDCWD, path, is_folder(path) ? AT_REMOVEDIR : 0);
}

static int cut(int fd, const char* path, off_t size)
{
    FAULT(CUT, path, -1);
    const int wanted = records(path);
    if (wanted)
        pthread_mutex_lock(&order);
    const long done = fd < 0 ? syscall(SYS_truncate, path, size) : syscall(SYS_ftruncate, fd, size);
    if (wanted && done == 0)
        record("cut", path, "", size, "", 0);
    if (wanted)
        pthread_mutex_unlock(&order);
    RETURN(done);
}

int truncate(const char* name, off_t size)
{
    char path[kLongest];
    path_at(AT_FDCWD, name, path);
    return cut(-1, path, size);
}

int ftruncate(int fd, off_t size)
{
    char path[kLongest];
    return cut(fd, descriptor_path(fd, path) ? path : "", size);
}
