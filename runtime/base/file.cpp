// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/file.h"

#include "runtime/base/memory_files.h"
#include "runtime/base/quote.h"
#include "runtime/base/renaming.h"
#include "runtime/base/text_start.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <functional>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

namespace semrover {

namespace {

constexpr size_t kMostListed = size_t(1) << 22; // of one folder

std::string system_message(int error)
{
    return std::generic_category().message(error);
}

class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Descriptor& operator=(Descriptor&& other) noexcept
    {
        std::swap(fd_, other.fd_);
        return *this;
    }
    ~Descriptor()
    {
        if (fd_ >= 0)
            ::close(fd_);
    }
    int get() const { return fd_; }

  private:
    int fd_;
};

struct OpenFile {
    Descriptor descriptor;
    uint64_t size;
};

Result<OpenFile> open_regular(const Path& path)
{
    // note: O_NONBLOCK so that a pipe without a writer is refused instead of waited for
    Descriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    if (descriptor.get() < 0)
        return fail(ErrorCode::bad_input, "cannot read {}: {}", quote_path(path), system_message(errno));
    struct stat status;
    if (::fstat(descriptor.get(), &status) != 0)
        return fail(ErrorCode::bad_input, "cannot read {}: {}", quote_path(path), system_message(errno));
    if (!S_ISREG(status.st_mode))
        return fail(ErrorCode::bad_input, "cannot read {}: expected a file, found {}", quote_path(path),
                    S_ISDIR(status.st_mode) ? "a folder" : "a device or pipe");
    return OpenFile{std::move(descriptor), static_cast<uint64_t>(status.st_size)};
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
    SR_TRY(const OpenFile file, open_regular(path));
    SR_CHECK(check_length(path, file.size, max_bytes));
    buffer.resize(file.size);
    for (uint64_t done = 0; done < file.size;) {
        const ssize_t n = ::read(file.descriptor.get(), buffer.data() + done, file.size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return fail(ErrorCode::bad_input, "cannot read {}: {}", quote_path(path), system_message(errno));
        if (n == 0)
            return fail(ErrorCode::bad_input, "cannot read {}: it was cut from {} to {} bytes while being read",
                        quote_path(path), file.size, done);
        done += static_cast<uint64_t>(n);
    }
    return buffer;
}

Path folder_of(const Path& path)
{
    const Path folder = path.parent_path();
    return folder.empty() ? Path(".") : folder;
}

// makes the rename itself survive a power cut; a file system that cannot flush folders says EINVAL
Status flush_folder(const Path& folder)
{
    const Descriptor descriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (descriptor.get() < 0 || (::fsync(descriptor.get()) != 0 && errno != EINVAL))
        return fail(ErrorCode::bad_input, "cannot flush folder {}: {}", quote_path(folder), system_message(errno));
    return {};
}

tl::unexpected<Error> cannot_write(const Path& path, int error)
{
    return fail(ErrorCode::bad_input, "cannot write {}: {}", quote_path(path), system_message(error));
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

bool is_there(const Path& path)
{
    std::error_code ignored;
    return find_in_memory(path) || std::filesystem::exists(path, ignored);
}

bool is_file(const Path& path)
{
    std::error_code ignored;
    if (const auto entry = find_in_memory(path))
        return !entry->folder;
    return std::filesystem::is_regular_file(path, ignored);
}

bool is_folder(const Path& path)
{
    std::error_code ignored;
    if (const auto entry = find_in_memory(path))
        return entry->folder;
    return std::filesystem::is_directory(path, ignored);
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
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot create {}: {}", quote_path(path), error.message());
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

AtomicFile::AtomicFile(Path path, Path temporary, int descriptor, std::unique_ptr<Unfinished> unfinished)
    : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor),
      unfinished_(std::move(unfinished))
{
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)), temporary_(std::exchange(other.temporary_, {})),
      descriptor_(std::exchange(other.descriptor_, -1)), unfinished_(std::move(other.unfinished_))
{
}

AtomicFile::~AtomicFile()
{
    discard();
}

void AtomicFile::discard() noexcept
{
    if (descriptor_ >= 0)
        ::close(descriptor_);
    if (!temporary_.empty())
        ::unlink(temporary_.c_str());
    descriptor_ = -1;
    temporary_.clear();
    unfinished_.reset();
}

Result<AtomicFile> AtomicFile::create(const Path& path)
{
    if (path.filename().empty())
        return fail(ErrorCode::bad_input, "cannot write {}: it names no file", quote_path(path));
    struct stat status;
    if (::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode))
        return fail(ErrorCode::bad_input, "cannot write {}: it is {}, not a file", quote_path(path),
                    S_ISDIR(status.st_mode) ? "a folder" : "a device or pipe");
    for (int attempt = 0; attempt < 100; ++attempt) { // a killed run with the same pid may have left its name
        // the name is short whatever the length of the final one (NAME_MAX is 255)
        Path temporary = folder_of(path) / unfinished_name();
        const Together created_and_known;
        const int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0) {
            auto unfinished = std::make_unique<Unfinished>(temporary);
            return AtomicFile(path, std::move(temporary), fd, std::move(unfinished));
        }
        if (errno != EEXIST)
            return cannot_write(path, errno);
    }
    return cannot_write(path, EEXIST);
}

Status AtomicFile::write(std::span<const std::byte> bytes)
{
    SR_ASSERT(descriptor_ >= 0, "write to {} after commit, move or error", path_.native());
    for (size_t done = 0; done < bytes.size();) {
        const ssize_t n = ::write(descriptor_, bytes.data() + done, bytes.size() - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0) {
            const int error = errno;
            discard();
            return cannot_write(path_, error);
        }
        done += static_cast<size_t>(n);
    }
    return {};
}

Status AtomicFile::flush()
{
    SR_ASSERT(descriptor_ >= 0, "flush of {} after flush, commit, move or error", path_.native());
    // note: close may report a late write error (NFS, quota), so it is checked before the rename
    int error = ::fsync(descriptor_) == 0 || errno == EINVAL ? 0 : errno;
    if (::close(std::exchange(descriptor_, -1)) != 0 && !error)
        error = errno;
    if (!error)
        return {};
    discard();
    return cannot_write(path_, error);
}

Status AtomicFile::commit()
{
    SR_ASSERT(!temporary_.empty(), "commit of {} after commit, move or error", path_.native());
    if (descriptor_ >= 0)
        SR_CHECK(flush());
    const Together renamed_and_forgotten;
    if (const int error = rename_surely(temporary_, path_)) {
        discard();
        return cannot_write(path_, error);
    }
    temporary_.clear();
    unfinished_.reset();
    return flush_folder(folder_of(path_));
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
            ::unlink(i->path().c_str());
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
    SR_TRY(const OpenFile file, open_regular(path));
    if (file.size == 0) // mmap refuses length 0
        return mapped;
    void* data = ::mmap(nullptr, file.size, PROT_READ, MAP_PRIVATE, file.descriptor.get(), 0);
    if (data == MAP_FAILED)
        return fail(ErrorCode::bad_input, "cannot map {} ({} bytes): {}", quote_path(path), file.size,
                    system_message(errno));
    mapped.data_ = static_cast<const std::byte*>(data);
    mapped.size_ = file.size;
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
        ::munmap(const_cast<std::byte*>(data_), size_);
}

} // namespace semrover
