// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifdef _WIN32
#include "runtime/system/system.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cwchar>
#include <fcntl.h>
#include <io.h>
#include <limits>
#include <system_error>
#include <windows.h>

namespace semrover::system {

namespace {

int errno_of(DWORD error)
{
    return std::system_category().default_error_condition(int(error)).value();
}

int last_error()
{
    const int error = errno_of(::GetLastError());
    return error ? error : EIO;
}

HANDLE handle_of(int number)
{
    return reinterpret_cast<HANDLE>(::_get_osfhandle(number));
}

OrError<FileFacts> facts_from(HANDLE handle)
{
    BY_HANDLE_FILE_INFORMATION found;
    if (!::GetFileInformationByHandle(handle, &found))
        return tl::unexpected(last_error());
    const bool folder = found.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY;
    const bool disk = ::GetFileType(handle) == FILE_TYPE_DISK;
    return FileFacts{disk && !folder, folder, uint64_t(found.nFileSizeHigh) << 32 | found.nFileSizeLow,
                     found.dwVolumeSerialNumber, uint64_t(found.nFileIndexHigh) << 32 | found.nFileIndexLow};
}

struct Opening {
    DWORD access, disposition, more;
    int flags; // of the C library
};

Opening opening_of(FileUse use)
{
    // note: a link is opened itself, and refused
    constexpr DWORD kOwn = FILE_FLAG_OPEN_REPARSE_POINT;
    switch (use) {
    case FileUse::read:
        return {GENERIC_READ, OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, _O_RDONLY};
    case FileUse::create:
        return {GENERIC_WRITE, CREATE_NEW, 0, 0};
    case FileUse::append:
        return {FILE_APPEND_DATA | FILE_READ_ATTRIBUTES | SYNCHRONIZE, OPEN_ALWAYS, kOwn, _O_APPEND};
    case FileUse::lock:
        return {GENERIC_READ | GENERIC_WRITE, OPEN_ALWAYS, kOwn, 0};
    }
    return {};
}

bool is_link(HANDLE handle)
{
    BY_HANDLE_FILE_INFORMATION found;
    return ::GetFileInformationByHandle(handle, &found) && (found.dwFileAttributes & FILE_ATTRIBUTE_REPARSE_POINT);
}

HANDLE open_shared(const Path& path, DWORD access, DWORD disposition, DWORD more)
{
    if (holds_nul(path)) {
        ::SetLastError(ERROR_INVALID_NAME);
        return INVALID_HANDLE_VALUE;
    }
    return ::CreateFileW(path.c_str(), access, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                         disposition, FILE_ATTRIBUTE_NORMAL | more, nullptr);
}

} // namespace

std::string message_of(int error)
{
    return std::generic_category().message(error);
}

OrError<FileFacts> facts_of(const Path& path)
{
    const HANDLE handle = open_shared(path, FILE_READ_ATTRIBUTES, OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS);
    if (handle == INVALID_HANDLE_VALUE)
        return tl::unexpected(last_error());
    auto facts = facts_from(handle);
    ::CloseHandle(handle);
    return facts;
}

OrError<File> File::open(const Path& path, FileUse use)
{
    const Opening o = opening_of(use);
    const HANDLE handle = open_shared(path, o.access, o.disposition, o.more);
    if (handle == INVALID_HANDLE_VALUE)
        return tl::unexpected(last_error());
    if ((o.more & FILE_FLAG_OPEN_REPARSE_POINT) && is_link(handle)) {
        ::CloseHandle(handle);
        return tl::unexpected(ELOOP);
    }
    const int number = ::_open_osfhandle(reinterpret_cast<intptr_t>(handle), o.flags | _O_BINARY | _O_NOINHERIT);
    if (number < 0) {
        ::CloseHandle(handle);
        return tl::unexpected(EMFILE);
    }
    return File(number);
}

OrError<FileFacts> File::facts() const
{
    return facts_from(handle_of(number_));
}

OrError<size_t> File::read(std::span<std::byte> bytes)
{
    DWORD n = 0;
    if (!::ReadFile(handle_of(number_), bytes.data(), DWORD(std::min<size_t>(bytes.size(), 1u << 30)), &n, nullptr))
        return ::GetLastError() == ERROR_BROKEN_PIPE ? OrError<size_t>(0) : tl::unexpected(last_error());
    return size_t(n);
}

int File::write(std::span<const std::byte> bytes)
{
    while (!bytes.empty()) {
        DWORD n = 0;
        if (!::WriteFile(handle_of(number_), bytes.data(), DWORD(std::min<size_t>(bytes.size(), 1u << 30)), &n,
                         nullptr))
            return last_error();
        bytes = bytes.subspan(n);
    }
    return 0;
}

int File::flush()
{
    return ::FlushFileBuffers(handle_of(number_)) ? 0 : last_error();
}

int File::close()
{
    return number_ < 0 || ::_close(std::exchange(number_, -1)) == 0 ? 0 : errno;
}

int File::lock()
{
    OVERLAPPED place{};
    place.Offset = place.OffsetHigh = 0x7fffffff; // beyond the file, whose bytes others may read
    if (::LockFileEx(handle_of(number_), LOCKFILE_EXCLUSIVE_LOCK | LOCKFILE_FAIL_IMMEDIATELY, 0, 1, 0, &place))
        return 0;
    const DWORD error = ::GetLastError();
    return error == ERROR_LOCK_VIOLATION || error == ERROR_IO_PENDING ? EWOULDBLOCK : errno_of(error);
}

OrError<const std::byte*> File::map(uint64_t bytes) const
{
    const HANDLE mapping =
        ::CreateFileMappingW(handle_of(number_), nullptr, PAGE_READONLY, DWORD(bytes >> 32), DWORD(bytes), nullptr);
    if (!mapping)
        return tl::unexpected(last_error());
    const void* data = ::MapViewOfFile(mapping, FILE_MAP_READ, 0, 0, size_t(bytes));
    const int error = data ? 0 : last_error();
    ::CloseHandle(mapping); // the view keeps it
    if (error)
        return tl::unexpected(error);
    return static_cast<const std::byte*>(data);
}

void unmap(const std::byte* data, uint64_t)
{
    ::UnmapViewOfFile(data);
}

bool says_no_locks(int error)
{
    return error == ENOLCK || error == ENOSYS || error == ENOTSUP;
}

int cut(const Path& file, uint64_t bytes)
{
    std::error_code error;
    std::filesystem::resize_file(file, bytes, error);
    return error.default_error_condition().value();
}

int flush_folder(const Path&)
{
    return 0; // what is renamed here is written through
}

void remove_file(const Path& file)
{
    ::DeleteFileW(file.c_str());
}

int copy_file(const Path& from, const Path& to)
{
    return ::CopyFileW(from.c_str(), to.c_str(), FALSE) ? 0 : last_error();
}

// A virus scanner or an indexer may have either open for a moment.
int rename_surely(const Path& from, const Path& to)
{
    for (DWORD wait = 1;; wait *= 2) {
        if (::MoveFileExW(from.c_str(), to.c_str(), MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH))
            return 0;
        const DWORD error = ::GetLastError();
        if (wait > 256 || (error != ERROR_SHARING_VIOLATION && error != ERROR_ACCESS_DENIED))
            return errno_of(error);
        ::Sleep(wait);
    }
}

int64_t process_number()
{
    return ::GetCurrentProcessId();
}

bool process_is_gone(int64_t number)
{
    const HANDLE process = ::OpenProcess(SYNCHRONIZE, FALSE, DWORD(number));
    if (!process)
        return ::GetLastError() == ERROR_INVALID_PARAMETER;
    const bool ended = ::WaitForSingleObject(process, 0) == WAIT_OBJECT_0;
    ::CloseHandle(process);
    return ended;
}

std::string host_name()
{
    char name[MAX_COMPUTERNAME_LENGTH + 1] = {};
    DWORD length = sizeof name;
    return ::GetComputerNameA(name, &length) ? std::string(name, length) : "";
}

Path user_cache_folder()
{
    const wchar_t* local = ::_wgetenv(L"LOCALAPPDATA");
    return local ? Path(local) : Path();
}

uint32_t usable_processors()
{
    DWORD_PTR ours = 0, all = 0;
    ::GetProcessAffinityMask(::GetCurrentProcess(), &ours, &all);
    return std::max(1u, uint32_t(__builtin_popcountll(ours)));
}

void close_descriptor(int descriptor)
{
    ::_close(descriptor);
}

} // namespace semrover::system

// In place of the C library's (-Wl,--wrap=mbrtowc): narrow text of a path is UTF-8 here, as path::string() makes it,
// and whatever the code page. libstdc++ takes it apart with this: one UTF-16 unit a call, of a character outside the
// first plane the second from its last byte.
extern "C" size_t __wrap_mbrtowc(wchar_t* to, const char* from, size_t bytes, std::mbstate_t* state);
extern "C" size_t __wrap_mbrtowc(wchar_t* to, const char* from, size_t bytes, std::mbstate_t* state)
{
    constexpr size_t kInvalid = size_t(-1), kTooShort = size_t(-2);
    if (bytes == 0)
        return kTooShort;
    if (*state) {
        *to = wchar_t(std::exchange(*state, 0));
        return 1;
    }
    const auto byte = [&](size_t i) { return uint32_t(static_cast<unsigned char>(from[i])); };
    const uint32_t first = byte(0);
    const size_t size = first < 0x80   ? 1
                        : first < 0xc2 ? 0
                        : first < 0xe0 ? 2
                        : first < 0xf0 ? 3
                        : first < 0xf5 ? 4
                                       : 0;
    if (size == 0)
        return kInvalid;
    uint32_t character = size == 1 ? first : first & (0x7f >> size);
    for (size_t i = 1; i < size; ++i) {
        if (i == bytes)
            return kTooShort;
        if ((byte(i) & 0xc0) != 0x80)
            return kInvalid;
        character = character << 6 | (byte(i) & 0x3f);
    }
    if (size < 4) {
        *to = wchar_t(character);
        return character ? size : 0;
    }
    *to = wchar_t(0xd7c0 + (character >> 10));
    *state = 0xdc00 | (character & 0x3ff);
    return 3;
}

// Likewise: mingw-w64's round up what lies just below a half, so that bytes of pictures were others than elsewhere.
// What is cut off is exact.
namespace {

template <typename Real>
Real rounded(Real x)
{
    const Real whole = std::trunc(x);
    return std::abs(x - whole) >= Real(0.5) ? whole + std::copysign(Real(1), x) : whole;
}

} // namespace

extern "C" double __wrap_round(double x);
extern "C" double __wrap_round(double x)
{
    return rounded(x);
}

extern "C" float __wrap_roundf(float x);
extern "C" float __wrap_roundf(float x)
{
    return rounded(x);
}

extern "C" long __wrap_lround(double x);
extern "C" long __wrap_lround(double x)
{
    return long(rounded(x));
}

extern "C" long __wrap_lroundf(float x);
extern "C" long __wrap_lroundf(float x)
{
    return long(rounded(x));
}
#endif
