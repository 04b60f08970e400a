// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

using Path = std::filesystem::path;

// false also where the answer cannot be had
bool is_there(const Path& path);
bool is_file(const Path& path); // a regular one, or a link to one
bool is_folder(const Path& path);

// with those above it; nothing to do where it is there
Status make_folder(const Path& path);

// the whole of a regular file; bad_input when it is missing, unreadable, a directory, a device or a pipe, or longer
// than max_bytes. Nothing is allocated before the length is known to fit.
Result<std::vector<std::byte>> read_file(const Path& path, uint64_t max_bytes);
Result<std::string> read_text_file(const Path& path, uint64_t max_bytes);

// a file that appears whole or not at all: written under a temporary name in the same folder, flushed to the disk,
// renamed over `path`, the folder flushed. Dropped without commit(), or after any error, it leaves nothing behind and
// what was at `path` before is intact (a process that is killed leaves a `.semrover-*.tmp`). Whether an existing file
// may be replaced is the caller's question.
class AtomicFile {
  public:
    // bad_input when the folder is missing or not writable, or `path` is a folder or a device
    static Result<AtomicFile> create(const Path& path);

    AtomicFile(AtomicFile&& other) noexcept;
    AtomicFile& operator=(AtomicFile&& other) noexcept;
    ~AtomicFile();

    // appends; bad_input when the disk is full or fails, and the file is then given up
    Status write(std::span<const std::byte> bytes);
    Status write(std::string_view text) { return write(std::as_bytes(std::span(text.data(), text.size()))); }

    Status commit(); // once, after the last write

  private:
    AtomicFile(Path path, Path temporary, int descriptor);
    void discard() noexcept;

    Path path_;
    Path temporary_; // empty when there is nothing to remove
    int descriptor_ = -1;
};

Status write_file_atomically(const Path& path, std::span<const std::byte> bytes);
Status write_file_atomically(const Path& path, std::string_view text);

// a regular file mapped for reading. Its length is fixed when it is opened.
// note: another process that truncates the file makes an access past the new end raise SIGBUS, so files are mapped
// only from storage that others do not write to; replace a file by renaming, as AtomicFile does.
class MappedFile {
  public:
    static Result<MappedFile> open(const Path& path);

    MappedFile() = default; // no bytes
    MappedFile(MappedFile&& other) noexcept;
    MappedFile& operator=(MappedFile&& other) noexcept;
    ~MappedFile();

    // page aligned; empty for an empty file
    std::span<const std::byte> bytes() const { return {data_, size_}; }

  private:
    void unmap() noexcept;

    const std::byte* data_ = nullptr;
    size_t size_ = 0;
};

} // namespace semrover
