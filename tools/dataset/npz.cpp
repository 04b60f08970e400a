// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/npz.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <zip.h>

namespace semrover {

namespace {

constexpr zip_int64_t kMaxEntries = 1024;
constexpr uint64_t kPiece = 1 << 20;
constexpr zip_uint16_t kDosDate = (0 << 9) | (1 << 5) | 1; // 1980-01-01, the first there is

std::string text_of(zip_error_t& error)
{
    return printable(zip_error_strerror(&error));
}

struct EntryCloser {
    void operator()(zip_file_t* file) const { zip_fclose(file); }
};
using Entry = std::unique_ptr<zip_file_t, EntryCloser>;

// an archive that is only read or thrown away
struct Discard {
    void operator()(zip_t* archive) const { zip_discard(archive); }
};
using Zip = std::unique_ptr<zip_t, Discard>;

template <typename T, typename From>
bool converts(const std::vector<From>& values, std::vector<T>& out)
{
    out.resize(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
        if constexpr (std::is_floating_point_v<From>) {
            if (!(double(values[i]) >= double(std::numeric_limits<T>::min()) &&
                  double(values[i]) <= double(std::numeric_limits<T>::max())) ||
                values[i] != std::floor(values[i]))
                return false;
        } else if (!std::in_range<T>(values[i])) {
            return false;
        }
        out[i] = static_cast<T>(values[i]);
    }
    return true;
}

std::vector<float> floats_of(const std::vector<uint16_t>& halves)
{
    std::vector<float> values;
    values.reserve(halves.size());
    for (const uint16_t half : halves)
        values.push_back(half_to_float(half));
    return values;
}

template <typename T>
std::optional<bool> convert_any(const NpyArray& array, std::vector<T>& out)
{
    switch (array.dtype) {
    case DType::boolean:
    case DType::u8:
        return converts(array.values<uint8_t>(), out);
    case DType::i8:
        return converts(array.values<int8_t>(), out);
    case DType::u16:
        return converts(array.values<uint16_t>(), out);
    case DType::i16:
        return converts(array.values<int16_t>(), out);
    case DType::u32:
        return converts(array.values<uint32_t>(), out);
    case DType::i32:
        return converts(array.values<int32_t>(), out);
    case DType::u64:
        return converts(array.values<uint64_t>(), out);
    case DType::i64:
        return converts(array.values<int64_t>(), out);
    case DType::f16:
        return converts(floats_of(array.values<uint16_t>()), out);
    case DType::f32:
        return converts(array.values<float>(), out);
    case DType::f64:
        return converts(array.values<double>(), out);
    default:
        return std::nullopt;
    }
}

} // namespace

struct NpzFile::Archive {
    MappedFile file; // outlives `zip`
    std::string where;
    Zip zip;
    std::map<std::string, zip_uint64_t, std::less<>> entries; // array to index

    Status list();
    Result<Entry> open_entry(zip_uint64_t index, const std::string& name, zip_stat_t& stat) const;
    Result<NpyHeader> read_header(zip_file_t* entry, const std::string& name, std::vector<std::byte>& rest) const;
    Result<zip_uint64_t> index_of(std::string_view array) const;
};

Status NpzFile::Archive::list()
{
    const zip_int64_t count = zip_get_num_entries(zip.get(), 0);
    if (count > kMaxEntries)
        return fail(ErrorCode::bad_input, "{}: {} entries, at most {} are allowed", where, count, kMaxEntries);
    for (zip_int64_t i = 0; i < count; ++i) {
        const char* raw = zip_get_name(zip.get(), static_cast<zip_uint64_t>(i), ZIP_FL_ENC_RAW);
        const std::string_view name = raw ? raw : "";
        if (!name.ends_with(".npy"))
            continue;
        if (!entries.emplace(name.substr(0, name.size() - 4), static_cast<zip_uint64_t>(i)).second)
            return fail(ErrorCode::bad_input, "{}: two entries {}", where, quote(name, 60));
    }
    return {};
}

Result<zip_uint64_t> NpzFile::Archive::index_of(std::string_view array) const
{
    const auto entry = entries.find(array);
    if (entry != entries.end())
        return entry->second;
    std::string names;
    for (const auto& [name, index] : entries)
        names += (names.empty() ? "" : ", ") + printable(name, 60);
    return fail(ErrorCode::bad_input, "{}: has no array {}, found {}", where, quote(array, 60),
                names.empty() ? "none" : printable(names, 400));
}

Result<Entry> NpzFile::Archive::open_entry(zip_uint64_t index, const std::string& name, zip_stat_t& stat) const
{
    zip_stat_init(&stat);
    if (zip_stat_index(zip.get(), index, 0, &stat) != 0 || !(stat.valid & ZIP_STAT_SIZE))
        return fail(ErrorCode::bad_input, "{}: cannot read the entry {}: {}", where, name,
                    text_of(*zip_get_error(zip.get())));
    Entry entry(zip_fopen_index(zip.get(), index, 0));
    if (!entry)
        return fail(ErrorCode::bad_input, "{}: cannot read the entry {}: {}", where, name,
                    text_of(*zip_get_error(zip.get())));
    return entry;
}

// `rest`: what was inflated beyond the header
Result<NpyHeader> NpzFile::Archive::read_header(zip_file_t* entry, const std::string& name,
                                                std::vector<std::byte>& rest) const
{
    rest.resize(kNpyHeaderBytes);
    size_t size = 0;
    while (size < rest.size()) {
        const zip_int64_t got = zip_fread(entry, rest.data() + size, rest.size() - size);
        if (got < 0)
            return fail(ErrorCode::bad_input, "{}: cannot inflate {}: {}", where, name,
                        text_of(*zip_file_get_error(entry)));
        if (got == 0)
            break;
        size += static_cast<size_t>(got);
    }
    rest.resize(size);
    const std::string_view text(reinterpret_cast<const char*>(rest.data()), size);
    SR_TRY(NpyHeader header, parse_npy_header(text, fmt::format("{}: {}", where, name)));
    rest.erase(rest.begin(), rest.begin() + static_cast<ptrdiff_t>(header.bytes));
    return header;
}

NpzFile::NpzFile(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
NpzFile::NpzFile(NpzFile&&) noexcept = default;
NpzFile::~NpzFile() = default;

Result<NpzFile> NpzFile::open(const Path& path)
{
    auto archive = std::make_unique<Archive>();
    archive->where = quote_path(path);
    SR_TRY(archive->file, MappedFile::open(path));
    const auto bytes = archive->file.bytes();
    zip_error_t error;
    zip_error_init(&error);
    zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
    if (source)
        archive->zip.reset(zip_open_from_source(source, ZIP_RDONLY, &error));
    if (!archive->zip) {
        const std::string text = text_of(error);
        zip_error_fini(&error);
        if (source)
            zip_source_free(source);
        return fail(ErrorCode::bad_input, "{}: no .npz archive: {}", archive->where, text);
    }
    zip_error_fini(&error);
    SR_CHECK(archive->list());
    return NpzFile(std::move(archive));
}

bool NpzFile::has(std::string_view array) const
{
    return archive_->entries.contains(array);
}

std::vector<std::string> NpzFile::names() const
{
    std::vector<std::string> names;
    for (const auto& [name, index] : archive_->entries)
        names.push_back(name);
    return names;
}

Result<NpyHeader> NpzFile::header(std::string_view array) const
{
    SR_TRY(const zip_uint64_t index, archive_->index_of(array));
    zip_stat_t stat;
    const std::string name = quote(array, 60);
    SR_TRY(const Entry entry, archive_->open_entry(index, name, stat));
    std::vector<std::byte> rest;
    return archive_->read_header(entry.get(), name, rest);
}

Result<NpyArray> NpzFile::read(std::string_view array, uint64_t max_bytes) const
{
    const Archive& a = *archive_;
    SR_TRY(const zip_uint64_t index, a.index_of(array));
    zip_stat_t stat;
    const std::string name = quote(array, 60);
    SR_TRY(const Entry entry, a.open_entry(index, name, stat));
    std::vector<std::byte> data;
    SR_TRY(const NpyHeader header, a.read_header(entry.get(), name, data));
    if (header.data_bytes > max_bytes)
        return fail(ErrorCode::bad_input, "{}: {}: an array of {} bytes, at most {} are expected", a.where, name,
                    header.data_bytes, max_bytes);
    if (stat.size != header.bytes + header.data_bytes)
        return fail(ErrorCode::bad_input, "{}: {}: the zip says {} bytes, the array's header {}", a.where, name,
                    stat.size, header.bytes + header.data_bytes);
    // one byte more than there may be, so that a longer entry shows; zip checks the CRC at its end
    while (data.size() <= header.data_bytes) {
        const size_t had = data.size();
        data.resize(had + std::min(kPiece, header.data_bytes + 1 - had));
        const zip_int64_t got = zip_fread(entry.get(), data.data() + had, data.size() - had);
        if (got < 0)
            return fail(ErrorCode::bad_input, "{}: cannot inflate {}: {}", a.where, name,
                        text_of(*zip_file_get_error(entry.get())));
        data.resize(had + static_cast<size_t>(got));
        if (got == 0)
            break;
    }
    if (data.size() != header.data_bytes)
        return fail(ErrorCode::bad_input, "{}: {}: expected {} bytes of data, found {}", a.where, name,
                    header.data_bytes, data.size() > header.data_bytes ? "more" : fmt::format("{}", data.size()));
    return decode_npy(header, std::move(data));
}

Result<double> NpzFile::number(std::string_view name) const
{
    SR_TRY(const NpyArray array, read(name, 8));
    if (array.dtype == DType::f32 && array.elements() == 1)
        return double(array.values<float>()[0]);
    if (array.dtype == DType::f64 && array.elements() == 1)
        return array.values<double>()[0];
    return fail(ErrorCode::bad_input, "{}: {}: expected one float, found [{}] of {}", archive_->where, name,
                fmt::join(array.shape, ", "), dtype_name(array.dtype));
}

namespace {

// the archive's bytes, taken from libzip before its source goes
Result<std::vector<std::byte>> zip_bytes(const Path& path, const std::map<std::string, std::vector<std::byte>>& entries)
{
    const auto refuse = [&](std::string_view text) {
        return fail(ErrorCode::internal, "cannot write {}: {}", quote_path(path), printable(text));
    };
    zip_error_t error;
    zip_error_init(&error);
    zip_source_t* buffer = zip_source_buffer_create(nullptr, 0, 0, &error);
    if (!buffer)
        return refuse(zip_error_strerror(&error));
    zip_source_keep(buffer);
    const std::unique_ptr<zip_source_t, decltype(&zip_source_free)> owner(buffer, zip_source_free);
    Zip zip(zip_open_from_source(buffer, ZIP_TRUNCATE, &error));
    if (!zip) {
        zip_source_free(buffer);
        return refuse(zip_error_strerror(&error));
    }
    for (const auto& [name, bytes] : entries) {
        zip_source_t* source = zip_source_buffer(zip.get(), bytes.data(), bytes.size(), 0);
        const zip_int64_t index =
            source ? zip_file_add(zip.get(), (name + ".npy").c_str(), source, ZIP_FL_ENC_UTF_8) : -1;
        if (index < 0 && source)
            zip_source_free(source);
        if (index < 0 || zip_set_file_compression(zip.get(), zip_uint64_t(index), ZIP_CM_STORE, 0) != 0 ||
            zip_file_set_dostime(zip.get(), zip_uint64_t(index), 0, kDosDate, 0) != 0)
            return refuse(zip_error_strerror(zip_get_error(zip.get())));
    }
    if (zip_close(zip.get()) != 0)
        return refuse(zip_error_strerror(zip_get_error(zip.get())));
    static_cast<void>(zip.release());
    zip_stat_t stat;
    if (zip_source_stat(buffer, &stat) != 0 || zip_source_open(buffer) != 0)
        return refuse("the archive is not there");
    std::vector<std::byte> bytes(stat.size);
    const zip_int64_t got = zip_source_read(buffer, bytes.data(), bytes.size());
    zip_source_close(buffer);
    if (got != static_cast<zip_int64_t>(bytes.size()))
        return refuse("the archive is cut short");
    return bytes;
}

} // namespace

Status write_npz(const Path& path, const std::map<std::string, NpyArray>& arrays)
{
    std::map<std::string, std::vector<std::byte>> entries;
    for (const auto& [name, array] : arrays)
        entries[name] = encode_npy(array);
    SR_TRY(const std::vector<std::byte> bytes, zip_bytes(path, entries));
    return write_file_atomically(path, bytes);
}

template <typename T>
Result<std::vector<T>> whole_numbers(const NpyArray& array, std::string_view where)
{
    std::vector<T> out;
    const std::optional<bool> fits = convert_any(array, out);
    if (!fits)
        return fail(ErrorCode::bad_input, "{}: expected whole numbers, found {}", where, dtype_name(array.dtype));
    if (!*fits)
        return fail(ErrorCode::bad_input, "{}: expected whole numbers of {} to {}, found another", where,
                    std::numeric_limits<T>::min(), std::numeric_limits<T>::max());
    return out;
}

template Result<std::vector<uint8_t>> whole_numbers(const NpyArray&, std::string_view);
template Result<std::vector<int32_t>> whole_numbers(const NpyArray&, std::string_view);
template Result<std::vector<uint32_t>> whole_numbers(const NpyArray&, std::string_view);

} // namespace semrover
