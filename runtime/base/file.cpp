// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/file.h"

#include "runtime/base/final_name.h"
#include "runtime/base/memory_files.h"
#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"
#include "runtime/system/system.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>

namespace semrover {

namespace {

constexpr size_t kMostListed = size_t(1) << 22; // of one folder
constexpr size_t kPieceBytes = size_t(1) << 18; // stay in a cache

// none: it cannot be examined
FileType type_of(const Path& path, std::error_code& error)
{
    if (const auto entry = find_in_memory(path))
        return entry->folder ? FileType::directory : FileType::regular;
    return std::filesystem::status(path, error).type();
}

// unknown: what stands for what cannot be examined. A name that is too long for any file is not there
FileType type_or(FileType unknown, const Path& path)
{
    std::error_code error;
    const FileType type = type_of(path, error);
    if (error == std::errc::filename_too_long)
        return FileType::not_found;
    return type == FileType::none ? unknown : type;
}

struct OpenFile {
    system::File file;
    uint64_t size;
};

tl::unexpected<Error> cannot_read(const Path& path, int error)
{
    return fail(ErrorCode::bad_input, "cannot read {}: {}", quote_path(path), system::message_of(error));
}

Result<OpenFile> open_regular(const Path& path)
{
    auto file = system::File::open(path, system::FileUse::read);
    if (!file)
        return cannot_read(path, file.error());
    const auto facts = file->facts();
    if (!facts)
        return cannot_read(path, facts.error());
    if (!facts->regular)
        return fail(ErrorCode::bad_input, "cannot read {}: expected a file, found {}", quote_path(path),
                    facts->folder ? "a folder" : "a device or pipe");
    return OpenFile{std::move(*file), facts->bytes};
}

Status check_length(const Path& path, uint64_t bytes, uint64_t max_bytes)
{
    if (bytes > max_bytes)
        return fail(ErrorCode::bad_input, "cannot read {}: expected at most {} bytes, found {}", quote_path(path),
                    max_bytes, bytes);
    return {};
}

// of a folder in memory
Result<std::span<const std::byte>> bytes_of(const MemoryEntry& entry, const Path& path)
{
    if (entry.folder)
        return fail(ErrorCode::bad_input, "cannot read {}: expected a file, found a folder", quote_path(path));
    return entry.bytes;
}

// the next bytes, `done` of them are read
Result<size_t> read_some(OpenFile& open, const Path& path, std::span<std::byte> to, uint64_t done)
{
    const auto n = open.file.read(to);
    if (!n)
        return cannot_read(path, n.error());
    if (*n == 0)
        return fail(ErrorCode::bad_input, "cannot read {}: it was cut from {} to {} bytes while being read",
                    quote_path(path), open.size, done);
    return *n;
}

template <typename Buffer>
Result<Buffer> read_whole(const Path& path, uint64_t max_bytes)
{
    Buffer buffer;
    if (const auto entry = find_in_memory(path)) {
        SR_TRY(const std::span<const std::byte> bytes, bytes_of(*entry, path));
        SR_CHECK(check_length(path, bytes.size(), max_bytes));
        buffer.resize(bytes.size());
        if (!bytes.empty())
            std::memcpy(buffer.data(), bytes.data(), bytes.size());
        return buffer;
    }
    SR_TRY(OpenFile open, open_regular(path));
    SR_CHECK(check_length(path, open.size, max_bytes));
    buffer.resize(open.size);
    const auto all = std::as_writable_bytes(std::span(buffer));
    for (uint64_t done = 0; done < open.size;) {
        SR_TRY(const size_t n, read_some(open, path, all.subspan(done), done));
        done += n;
    }
    return buffer;
}

tl::unexpected<Error> cannot_write(const Path& path, int error)
{
    return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(path), system::message_of(error));
}

// Paths in a folder that pass the test, sorted: what an iterator finds on the disk, and what `part` makes of the names
// in memory below it (empty: nothing)
template <typename Iterator, typename Part, typename Test>
Result<std::vector<Path>> list(const Path& folder, Part part, Test test)
{
    std::vector<Path> found;
    const auto add = [&](Path path) {
        if (found.size() < kMostListed)
            found.push_back(std::move(path));
        return found.size() < kMostListed;
    };
    const std::vector<std::string> names = names_in_memory(folder);
    for (const std::string& name : names)
        if (const std::string kept = part(name); !kept.empty() && (found.empty() || found.back() != folder / kept))
            add(folder / kept);
    std::error_code error;
    for (Iterator i(folder, error), end; !error && i != end; i.increment(error))
        if (test(i->path()) && !add(i->path()))
            break;
    if (error && names.empty())
        return fail(ErrorCode::bad_input, "cannot list {}: {}", quote_path(folder), error.message());
    if (found.size() == kMostListed)
        return fail(ErrorCode::bad_input, "cannot list {}: expected fewer than {} files", quote_path(folder),
                    kMostListed);
    std::ranges::sort(found);
    found.erase(std::ranges::unique(found).begin(), found.end());
    return found;
}

} // namespace

Result<FileType> examine(const Path& path)
{
    std::error_code error;
    const FileType type = type_of(path, error);
    if (type == FileType::none)
        return fail(ErrorCode::bad_input, "cannot examine {}: {}", quote_path(path), error.message());
    return type;
}

bool is_there(const Path& path)
{
    return type_or(FileType::none, path) != FileType::not_found;
}

bool is_file(const Path& path)
{
    return type_or(FileType::regular, path) == FileType::regular;
}

bool is_folder(const Path& path)
{
    return type_or(FileType::directory, path) == FileType::directory;
}

Result<std::vector<Path>> list_files(const Path& folder)
{
    const auto directly = [](const std::string& name) { return name.find('/') == std::string::npos ? name : ""; };
    return list<std::filesystem::directory_iterator>(folder, directly, is_file);
}

Result<std::vector<Path>> list_folders(const Path& folder)
{
    const auto first = [](const std::string& name) {
        const size_t end = name.find('/');
        return end == std::string::npos ? "" : name.substr(0, end);
    };
    return list<std::filesystem::directory_iterator>(folder, first, is_folder);
}

Result<std::vector<Path>> list_tree(const Path& folder)
{
    return list<std::filesystem::recursive_directory_iterator>(folder, std::identity(), is_file);
}

Status make_folder(const Path& path)
{
    std::vector<Path> made;
    for (Path above = path; !above.empty() && !is_there(above); above = above.parent_path())
        made.push_back(above);
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot create {}: {}", quote_path(path), error.message());
    for (const Path& folder : made)
        SR_CHECK(flush_names(folder_of(folder)));
    return {};
}

Status read_in_pieces(const Path& path, const std::function<void(uint64_t)>& begin,
                      const std::function<void(std::span<const std::byte>)>& piece)
{
    if (const auto entry = find_in_memory(path)) {
        SR_TRY(const std::span<const std::byte> bytes, bytes_of(*entry, path));
        begin(bytes.size());
        piece(bytes);
        return {};
    }
    SR_TRY(OpenFile open, open_regular(path));
    begin(open.size);
    std::vector<std::byte> buffer(std::min<uint64_t>(open.size, kPieceBytes));
    for (uint64_t done = 0; done < open.size;) {
        const auto room = std::span(buffer).first(std::min<uint64_t>(open.size - done, buffer.size()));
        SR_TRY(const size_t n, read_some(open, path, room, done));
        piece(room.first(n));
        done += n;
    }
    return {};
}

Result<std::vector<std::byte>> read_file(const Path& path, uint64_t max_bytes)
{
    return read_whole<std::vector<std::byte>>(path, max_bytes);
}

Result<std::string> read_text_file(const Path& path, uint64_t max_bytes)
{
    SR_TRY(std::string bytes, read_whole<std::string>(path, max_bytes));
    SR_TRY(const std::string_view text, text_after_mark(bytes, quote_path(path)));
    bytes.erase(0, bytes.size() - text.size());
    return bytes;
}

AtomicFile::AtomicFile(Path path, Path temporary, system::File file, std::unique_ptr<Unfinished> unfinished)
    : path_(std::move(path)), temporary_(std::move(temporary)), file_(std::move(file)),
      unfinished_(std::move(unfinished))
{
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)), temporary_(std::exchange(other.temporary_, {})), file_(std::move(other.file_)),
      unfinished_(std::move(other.unfinished_))
{
}

AtomicFile::~AtomicFile()
{
    discard();
}

void AtomicFile::discard() noexcept
{
    (void)file_.close();
    if (!temporary_.empty())
        system::remove_file(temporary_);
    temporary_.clear();
    unfinished_.reset();
}

Result<AtomicFile> AtomicFile::create(const Path& path)
{
    if (path.filename().empty())
        return fail(ErrorCode::bad_input, "cannot write {}: it names no file", quote_path(path));
    if (const auto facts = system::facts_of(path); facts && !facts->regular)
        return fail(ErrorCode::bad_input, "cannot write {}: it is {}, not a file", quote_path(path),
                    facts->folder ? "a folder" : "a device or pipe");
    for (int attempt = 0; attempt < 100; ++attempt) { // a killed run with the same pid may have left its name
        // the name is short whatever the length of the final one (NAME_MAX is 255)
        Path temporary = folder_of(path) / unfinished_name();
        const Together created_and_known;
        auto file = system::File::open(temporary, system::FileUse::create);
        if (file) {
            auto unfinished = std::make_unique<Unfinished>(temporary);
            return AtomicFile(path, std::move(temporary), std::move(*file), std::move(unfinished));
        }
        if (file.error() != EEXIST)
            return cannot_write(path, file.error());
    }
    return cannot_write(path, EEXIST);
}

Status AtomicFile::write(std::span<const std::byte> bytes)
{
    SR_ASSERT(bool(file_), "write to {} after commit, move or error", path_.string());
    const int error = file_.write(bytes);
    if (!error)
        return {};
    discard();
    return cannot_write(path_, error);
}

Status AtomicFile::flush()
{
    SR_ASSERT(bool(file_), "flush of {} after flush, commit, move or error", path_.string());
    // note: close may report a late write error (NFS, quota), so it is checked before the rename
    const int flushed = file_.flush(), closed = file_.close(), error = flushed ? flushed : closed;
    if (!error)
        return {};
    discard();
    return cannot_write(path_, error);
}

Status AtomicFile::commit()
{
    SR_ASSERT(!temporary_.empty(), "commit of {} after commit, move or error", path_.string());
    if (file_)
        SR_CHECK(flush());
    const Together renamed_and_forgotten;
    Status named = rename_whole(temporary_, path_);
    if (!named) {
        discard();
        return named;
    }
    temporary_.clear();
    unfinished_.reset();
    return {};
}

Status write_file_atomically(const Path& path, std::span<const std::byte> bytes)
{
    SR_TRY(AtomicFile file, AtomicFile::create(path));
    SR_CHECK(file.write(bytes));
    return file.commit();
}

Status write_file_atomically(const Path& path, std::string_view text)
{
    return write_file_atomically(path, std::as_bytes(std::span(text.data(), text.size())));
}

void remove_temporary_files(const Path& folder)
{
    std::error_code error;
    for (std::filesystem::recursive_directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
        if (is_abandoned(i->path()))
            system::remove_file(i->path());
    }
}

Result<MappedFile> MappedFile::open(const Path& path)
{
    MappedFile mapped;
    if (const auto entry = find_in_memory(path)) {
        SR_TRY(const std::span<const std::byte> bytes, bytes_of(*entry, path));
        mapped.data_ = bytes.data();
        mapped.size_ = bytes.size();
        mapped.borrowed_ = true;
        return mapped;
    }
    SR_TRY(const OpenFile open, open_regular(path));
    if (open.size == 0) // mapping refuses length 0
        return mapped;
    const auto data = open.file.map(open.size);
    if (!data)
        return fail(ErrorCode::bad_input, "cannot map {} ({} bytes): {}", quote_path(path), open.size,
                    system::message_of(data.error()));
    mapped.data_ = *data;
    mapped.size_ = open.size;
    return mapped;
}

MappedFile::MappedFile(MappedFile&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)),
      borrowed_(std::exchange(other.borrowed_, false))
{
}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept
{
    if (this != &other) {
        unmap();
        data_ = std::exchange(other.data_, nullptr);
        size_ = std::exchange(other.size_, 0);
        borrowed_ = std::exchange(other.borrowed_, false);
    }
    return *this;
}

MappedFile::~MappedFile()
{
    unmap();
}

void MappedFile::unmap() noexcept
{
    if (data_ && !borrowed_)
        system::unmap(data_, size_);
}

} // namespace semrover
