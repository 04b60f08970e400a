// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <tl/expected.hpp>

// What each operating system does in its own way. Nothing else calls POSIX or Windows. An int is 0 or an errno.
namespace semrover::system {

using Path = std::filesystem::path;
template <typename T>
using OrError = tl::expected<T, int>;

std::string message_of(int error);

// Calls of both systems would take the name up to there, and so another file
inline bool holds_nul(const Path& path)
{
    return path.native().find(Path::value_type(0)) != path.native().npos;
}

struct FileFacts {
    bool regular = false, folder = false;
    uint64_t bytes = 0;
    uint64_t volume = 0, number = 0; // together of this file alone, as long as it is there or open

    bool is(const FileFacts& other) const { return volume == other.volume && number == other.number; }
};
OrError<FileFacts> facts_of(const Path& path); // of what a link leads to

enum class FileUse {
    read,   // what is there. Does not wait for the other end of a pipe
    create, // written; EEXIST where something is there
    append, // written at its end; made where it is absent. ELOOP for a link
    lock    // likewise, for File::lock()
};

class Process;

// An open file, which other processes may rename and remove meanwhile. Child processes do not get it.
class File {
  public:
    static OrError<File> open(const Path& path, FileUse use);

    File() = default; // none
    File(File&& other) noexcept : number_(other.number_) { other.number_ = -1; }
    File& operator=(File&& other) noexcept
    {
        std::swap(number_, other.number_);
        return *this;
    }
    ~File() { (void)close(); }
    explicit operator bool() const { return number_ >= 0; }

    OrError<FileFacts> facts() const;
    OrError<size_t> read(std::span<std::byte> bytes); // as many as there are now; 0 at the end
    int write(std::span<const std::byte> bytes);      // all
    int flush();                                      // to the disk. 0 where the file system cannot
    int close();                                      // once; may report what an earlier write failed with (NFS, quota)
    // No other process has it while this file is open. EWOULDBLOCK: one has. Others: the file system has no locks
    int lock();
    OrError<const std::byte*> map(uint64_t bytes) const; // for reading, not 0 bytes; stays when the file is closed

  private:
    friend class Process;
    explicit File(int number) : number_(number) {}

    int number_ = -1;
};

void unmap(const std::byte* data, uint64_t bytes);

bool says_no_locks(int error);
int cut(const Path& file, uint64_t bytes);       // to a length
int flush_folder(const Path& folder);            // what was renamed in it is on the disk
void remove_file(const Path& file);              // if it is there
int copy_file(const Path& from, const Path& to); // in place of what is there; on the disk

// Renames a file or folder. Over a network the answer may be lost, and the second try, which nobody sees, finds nothing
// to rename: what is at `to` then is known again by its number.
int rename_surely(const Path& from, const Path& to);

int64_t process_number();
bool process_is_gone(int64_t number); // no process of this machine has the number
std::string host_name();              // empty: unknown
Path user_cache_folder();             // empty: none
uint32_t usable_processors();         // of this process, at least 1
void close_descriptor(int descriptor);

} // namespace semrover::system
