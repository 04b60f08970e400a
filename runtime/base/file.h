// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "runtime/base/unfinished.h"
#include "runtime/system/system.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

using Path = std::filesystem::path;

// Paths are of the disk, or of a folder in memory (memory_files.h), which can be read and not written. A folder may
// have files of both; of two at one path the one in memory is read.

// Also true of what cannot be examined (no permission, a failing disk): whoever opens it learns why. To take it for
// absent would leave out what is there, or write over it.
bool is_there(const Path& path);
bool is_file(const Path& path); // a regular one, or a link to one
bool is_folder(const Path& path);
// For who looks elsewhere where nothing is there, or else refuses to write. bad_input: it cannot be examined
using FileType = std::filesystem::file_type;
Result<FileType> examine(const Path& path);

// The regular files directly in a folder, sorted. bad_input: it cannot be listed.
Result<std::vector<Path>> list_files(const Path& folder);
// The folders directly in a folder, links to folders among them, sorted. bad_input: it cannot be listed.
Result<std::vector<Path>> list_folders(const Path& folder);
// The regular files in a folder and below it, sorted; links to folders are not followed. bad_input: it cannot be
// listed, or holds 2^22 files or more.
Result<std::vector<Path>> list_tree(const Path& folder);

// Makes a folder and those above it, on the disk when this returns; it may exist.
Status make_folder(const Path& path);

// Reads a whole regular file. The length is checked before anything is allocated. bad_input: it is missing,
// unreadable, a directory, a device or a pipe, or longer than max_bytes.
Result<std::vector<std::byte>> read_file(const Path& path, uint64_t max_bytes);
Result<std::string> read_text_file(const Path& path, uint64_t max_bytes);
// Reads a regular file once, from its begin: its length, then its bytes, each piece for as long as the call. Errors: as
// read_file(), also after some pieces. Three times as fast as a MappedFile on a virtual machine: no page is mapped.
Status read_in_pieces(const Path& path, const std::function<void(uint64_t)>& begin,
                      const std::function<void(std::span<const std::byte>)>& piece);

// A file that appears whole or not at all. It is written under a temporary name in the same folder; commit() flushes
// it to the disk, renames it over `path` and flushes the folder. Without commit(), or after an error, nothing is left
// and the old file is intact. A process that is killed leaves a `.semrover-*.tmp`. The caller decides whether an
// existing file may be replaced.
class AtomicFile {
  public:
    // bad_input when the folder is missing or not writable, or `path` is a folder or a device
    static Result<AtomicFile> create(const Path& path);

    AtomicFile(AtomicFile&& other) noexcept;
    ~AtomicFile();

    // Appends. bad_input when the disk is full or fails; the file is then discarded.
    Status write(std::span<const std::byte> bytes);
    Status write(std::string_view text) { return write(std::as_bytes(std::span(text.data(), text.size()))); }

    // After the last write: the bytes are on the disk, still under the temporary name. commit() does it where it was
    // not done. Errors: as write()
    Status flush();
    Status commit(); // once, after the last write

  private:
    AtomicFile(Path path, Path temporary, system::File file, std::unique_ptr<Unfinished> unfinished);
    void discard() noexcept;

    Path path_;
    Path temporary_;    // empty when there is nothing to remove
    system::File file_; // none from flush() on
    std::unique_ptr<Unfinished> unfinished_;
};

Status write_file_atomically(const Path& path, std::span<const std::byte> bytes);
Status write_file_atomically(const Path& path, std::string_view text);

// Removes what killed processes were writing below `folder`: files that is_abandoned() of unfinished.h.
void remove_temporary_files(const Path& folder);

// A regular file mapped for reading. Its length is fixed when it is opened.
// note: if another process truncates the file, an access past the new end raises SIGBUS. Map only files that others do
// not write to; replace a file by renaming, as AtomicFile does.
class MappedFile {
  public:
    static Result<MappedFile> open(const Path& path);

    MappedFile() = default; // no bytes
    MappedFile(MappedFile&& other) noexcept;
    MappedFile& operator=(MappedFile&& other) noexcept;
    ~MappedFile();

    // empty for an empty file
    std::span<const std::byte> bytes() const { return {data_, size_}; }

  private:
    void unmap() noexcept;

    const std::byte* data_ = nullptr;
    size_t size_ = 0;
    bool borrowed_ = false; // of a folder in memory
};

} // namespace semrover
