// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/safetensors_header.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cstring>

namespace semrover {

namespace {

constexpr uint64_t kMaxInteger = uint64_t(1) << 53; // beyond it a reader that uses doubles sees another number

struct DTypeName {
    std::string_view name;
    uint32_t bits;
    std::optional<DType> dtype;
};

// all 22 dtypes of the format
constexpr DTypeName kDTypeNames[] = {
    {"F32", 32, DType::f32},     {"F16", 16, DType::f16}, {"BF16", 16, DType::bf16}, {"I64", 64, DType::i64},
    {"I32", 32, DType::i32},     {"U32", 32, DType::u32}, {"I16", 16, DType::i16},   {"U16", 16, DType::u16},
    {"I8", 8, DType::i8},        {"U8", 8, DType::u8},    {"F64", 64, DType::f64},   {"U64", 64, DType::u64},
    {"BOOL", 8, DType::boolean}, {"F4", 4, {}},           {"F6_E2M3", 6, {}},        {"F6_E3M2", 6, {}},
    {"F8_E5M2", 8, {}},          {"F8_E4M3", 8, {}},      {"F8_E8M0", 8, {}},        {"F8_E4M3FNUZ", 8, {}},
    {"F8_E5M2FNUZ", 8, {}},      {"C64", 64, {}},
};

const DTypeName* find_dtype(std::string_view name)
{
    const auto* found = std::ranges::find(kDTypeNames, name, &DTypeName::name);
    return found == std::end(kDTypeNames) ? nullptr : found;
}

bool is_control_character(char c)
{
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
}

// {"__metadata__": {key: text, ...}, name: {"dtype": text, "shape": [n, ...], "data_offsets": [begin, end]}, ...}
class HeaderReader : public JsonEvents {
  public:
    explicit HeaderReader(SafetensorsHeader& header) : header_(header) {}

    bool null() override { return unexpected("null"); }
    bool boolean(bool value) override { return unexpected(value ? "true" : "false"); }
    // negative ones only, -0 among them
    bool number_integer(number_integer_t value) override
    {
        return unexpected(fmt::format("the negative number -{}", value == 0 ? 0 : 0 - static_cast<uint64_t>(value)));
    }
    bool number_float(number_float_t, const string_t& digits) override
    {
        return unexpected(fmt::format("the number {}", printable(digits, 40)));
    }
    bool number_unsigned(number_unsigned_t value) override;
    bool string(string_t& value) override;
    bool key(string_t& name) override;
    bool start_object(size_t) override;
    bool end_object() override;
    bool start_array(size_t) override;
    bool end_array() override;

  private:
    // what comes next
    enum class Next {
        header,
        name,
        metadata,
        metadata_key,
        metadata_text,
        tensor,
        field,
        dtype,
        shape,
        dim,
        offsets,
        offset
    };

    bool unexpected(std::string_view found);
    bool tensor_key(string_t& name);
    bool metadata_key(const string_t& name);
    bool field_key(const string_t& name);
    bool finish_tensor();

    SafetensorsHeader& header_;
    Next next_ = Next::header;
    bool metadata_seen_ = false;
    std::string key_;     // of the tensor or metadata entry being read
    unsigned fields_ = 0; // bits of Field that this tensor has had
    std::string dtype_;
    std::vector<uint64_t> shape_;
    uint64_t offsets_[2] = {};
    size_t offset_count_ = 0;
};

enum Field : unsigned { kDType = 1, kShape = 2, kOffsets = 4 };

bool HeaderReader::unexpected(std::string_view found)
{
    switch (next_) {
    case Next::header:
    case Next::name:
        return refuse(fmt::format("expected the header to be an object, found {}", found));
    case Next::metadata:
        return refuse(fmt::format("expected __metadata__ to be an object, found {}", found));
    case Next::metadata_key:
    case Next::metadata_text:
        return refuse(fmt::format("metadata {}: expected text, found {}", quote(key_), found));
    case Next::tensor:
    case Next::field:
        return refuse(fmt::format("tensor {}: expected an object, found {}", quote(key_), found));
    case Next::dtype:
        return refuse(fmt::format("tensor {}: expected dtype to be text, found {}", quote(key_), found));
    case Next::shape:
        return refuse(fmt::format("tensor {}: expected shape to be an array, found {}", quote(key_), found));
    case Next::dim:
        return refuse(fmt::format("tensor {}: expected shape to hold whole numbers, found {}", quote(key_), found));
    case Next::offsets:
        return refuse(fmt::format("tensor {}: expected data_offsets to be an array, found {}", quote(key_), found));
    case Next::offset:
        return refuse(
            fmt::format("tensor {}: expected data_offsets to hold whole numbers, found {}", quote(key_), found));
    }
    return false;
}

bool HeaderReader::start_object(size_t)
{
    switch (next_) {
    case Next::header:
        next_ = Next::name;
        return true;
    case Next::metadata:
        next_ = Next::metadata_key;
        return true;
    case Next::tensor:
        next_ = Next::field;
        fields_ = 0;
        return true;
    default:
        return unexpected("an object");
    }
}

bool HeaderReader::key(string_t& name)
{
    if (next_ == Next::field)
        return field_key(name);
    if (name.size() > kMaxTensorName)
        return refuse(
            fmt::format("name {} has {} bytes, at most {} are allowed", quote(name, 40), name.size(), kMaxTensorName));
    if (std::ranges::any_of(name, is_control_character))
        return refuse(fmt::format("name {} holds a control character", quote(name)));
    return next_ == Next::name ? tensor_key(name) : metadata_key(name);
}

bool HeaderReader::tensor_key(string_t& name)
{
    if (name == "__metadata__") {
        if (std::exchange(metadata_seen_, true))
            return refuse("__metadata__ appears twice");
        next_ = Next::metadata;
        return true;
    }
    if (name.find("/../") != std::string::npos)
        return refuse(fmt::format("tensor name {} holds '/../'", quote(name)));
    if (header_.tensors.size() + header_.unsupported.size() >= kMaxTensors)
        return refuse(fmt::format("more than {} tensors", kMaxTensors));
    key_ = std::move(name);
    next_ = Next::tensor;
    return true;
}

bool HeaderReader::metadata_key(const string_t& name)
{
    if (header_.metadata.size() >= kMaxMetadataEntries)
        return refuse(fmt::format("more than {} metadata entries", kMaxMetadataEntries));
    if (!header_.metadata.try_emplace(name).second)
        return refuse(fmt::format("metadata {} appears twice", quote(name)));
    key_ = name;
    next_ = Next::metadata_text;
    return true;
}

bool HeaderReader::field_key(const string_t& name)
{
    struct Known {
        std::string_view name;
        Field bit;
        Next next;
    };
    static constexpr Known kFields[] = {
        {"dtype", kDType, Next::dtype}, {"shape", kShape, Next::shape}, {"data_offsets", kOffsets, Next::offsets}};
    const auto* field = std::ranges::find(kFields, std::string_view(name), &Known::name);
    if (field == std::end(kFields))
        return refuse(fmt::format("tensor {}: unknown field {}", quote(key_), quote(name, 40)));
    if (fields_ & field->bit)
        return refuse(fmt::format("tensor {}: {} appears twice", quote(key_), field->name));
    fields_ |= field->bit;
    next_ = field->next;
    return true;
}

bool HeaderReader::string(string_t& value)
{
    if (next_ == Next::metadata_text) {
        header_.metadata[key_] = std::move(value);
        next_ = Next::metadata_key;
        return true;
    }
    if (next_ != Next::dtype)
        return unexpected(quote(value, 40));
    if (value.empty() || value.size() > 32 || std::ranges::any_of(value, is_control_character))
        return refuse(fmt::format("tensor {}: {} is no dtype", quote(key_), quote(value, 40)));
    dtype_ = std::move(value);
    next_ = Next::field;
    return true;
}

bool HeaderReader::start_array(size_t)
{
    if (next_ == Next::shape) {
        shape_.clear();
        next_ = Next::dim;
    } else if (next_ == Next::offsets) {
        offset_count_ = 0;
        next_ = Next::offset;
    } else {
        return unexpected("an array");
    }
    return true;
}

bool HeaderReader::number_unsigned(number_unsigned_t value)
{
    if (next_ != Next::dim && next_ != Next::offset)
        return unexpected(fmt::format("the number {}", value));
    if (value > kMaxInteger)
        return refuse(fmt::format("tensor {}: the number {} exceeds 2^53", quote(key_), value));
    if (next_ == Next::dim) {
        if (shape_.size() == kMaxRank)
            return refuse(fmt::format("tensor {}: more than {} dimensions", quote(key_), kMaxRank));
        shape_.push_back(value);
        return true;
    }
    if (offset_count_ == 2)
        return refuse(fmt::format("tensor {}: expected 2 data_offsets, found more", quote(key_)));
    offsets_[offset_count_++] = value;
    return true;
}

bool HeaderReader::end_array()
{
    if (next_ == Next::offset && offset_count_ != 2)
        return refuse(fmt::format("tensor {}: expected 2 data_offsets, found {}", quote(key_), offset_count_));
    next_ = Next::field;
    return true;
}

bool HeaderReader::end_object()
{
    if (next_ == Next::field && !finish_tensor())
        return false;
    next_ = Next::name; // after a tensor or the metadata; after the header itself nothing can come
    return true;
}

bool HeaderReader::finish_tensor()
{
    if (fields_ != (kDType | kShape | kOffsets))
        return refuse(fmt::format("tensor {}: {} is missing", quote(key_),
                                  !(fields_ & kDType)   ? "dtype"
                                  : !(fields_ & kShape) ? "shape"
                                                        : "data_offsets"));
    const auto [begin, end] = offsets_;
    if (end < begin)
        return refuse(
            fmt::format("tensor {}: data_offsets end at {} before they begin at {}", quote(key_), end, begin));
    const DTypeName* dtype = find_dtype(dtype_);
    // of an unknown dtype only the limits on the shape can be checked, as if of bytes
    const Result<uint64_t> bytes = checked_bytes(shape_, dtype ? dtype->bits : 8);
    if (!bytes)
        return refuse(fmt::format("tensor {}: {}", quote(key_), bytes.error().message));
    if (dtype && *bytes != end - begin)
        return refuse(fmt::format("tensor {}: {} of shape {} has {} bytes, but data_offsets hold {}", quote(key_),
                                  dtype_, shape_text(shape_), *bytes, end - begin));
    if (dtype && dtype->dtype)
        header_.tensors.push_back({std::move(key_), *dtype->dtype, shape_, begin, end, 0});
    else
        header_.unsupported.push_back({std::move(key_), dtype_, shape_, begin, end});
    return true;
}

struct Extent {
    uint64_t begin, end;
    const std::string* name;
};

// every tensor once, in the order of its bytes
std::vector<Extent> extents(const SafetensorsHeader& header)
{
    std::vector<Extent> list;
    list.reserve(header.tensors.size() + header.unsupported.size());
    for (const TensorInfo& t : header.tensors)
        list.push_back({t.begin, t.end, &t.name});
    for (const UnsupportedTensor& t : header.unsupported)
        list.push_back({t.begin, t.end, &t.name});
    std::ranges::sort(list, {}, [](const Extent& e) { return std::pair(e.begin, e.end); });
    return list;
}

// both lists are sorted by name
Status check_names(const SafetensorsHeader& header, std::string_view where)
{
    const std::string* twice = nullptr;
    if (const auto t = std::ranges::adjacent_find(header.tensors, {}, &TensorInfo::name); t != header.tensors.end())
        twice = &t->name;
    for (size_t i = 0; i < header.unsupported.size(); ++i) {
        const std::string& name = header.unsupported[i].name;
        if ((i > 0 && header.unsupported[i - 1].name == name) ||
            std::ranges::binary_search(header.tensors, name, {}, &TensorInfo::name))
            twice = &name;
    }
    if (twice)
        return fail(ErrorCode::bad_input, "{}: tensor {} appears twice", where, quote(*twice));
    return {};
}

Status check_coverage(const std::vector<Extent>& list, uint64_t data_bytes, std::string_view where)
{
    uint64_t covered = 0;
    for (const Extent& e : list) {
        if (e.end > data_bytes)
            return fail(ErrorCode::bad_input,
                        "{}: tensor {} ends at byte {} of {} data bytes; the file is cut or damaged", where,
                        quote(*e.name), e.end, data_bytes);
        if (e.begin != covered)
            return fail(ErrorCode::bad_input, "{}: tensor {} begins at data byte {}, expected {}: {}", where,
                        quote(*e.name), e.begin, covered, e.begin < covered ? "tensors overlap" : "a hole");
        covered = e.end;
    }
    if (covered != data_bytes)
        return fail(ErrorCode::bad_input,
                    "{}: tensors end at data byte {}, but the file has {}: {} bytes belong to nothing", where, covered,
                    data_bytes, data_bytes - covered);
    return {};
}

// the JSON text, once its length is known to lie in the file
Result<std::string_view> header_text(std::span<const std::byte> file, std::string_view where,
                                     const SafetensorsLimits& limits)
{
    if (file.size() < 8)
        return fail(ErrorCode::bad_input, "{}: expected a safetensors file, found only {} bytes", where, file.size());
    uint64_t length = 0;
    for (int i = 7; i >= 0; --i)
        length = length << 8 | std::to_integer<uint64_t>(file[static_cast<size_t>(i)]);
    if (length > limits.header_bytes)
        return fail(ErrorCode::bad_input, "{}: header of {} bytes, at most {} are allowed; is it a safetensors file?",
                    where, length, limits.header_bytes);
    if (length > file.size() - 8)
        return fail(ErrorCode::bad_input, "{}: header of {} bytes, but only {} follow; the file is cut or damaged",
                    where, length, file.size() - 8);
    const std::string_view text(reinterpret_cast<const char*>(file.data()) + 8, length);
    const size_t first = text.find_first_not_of(" \t\r\n");
    if (first == std::string_view::npos)
        return fail(ErrorCode::bad_input, "{}: the header is empty", where);
    if (limits.strict && first != 0)
        return fail(ErrorCode::bad_input, "{}: white space before the header", where);
    return text;
}

} // namespace

std::string shape_text(std::span<const uint64_t> shape)
{
    return fmt::format("[{}]", fmt::join(shape, ", "));
}

Result<uint64_t> checked_bytes(std::span<const uint64_t> shape, uint32_t bits_per_element)
{
    if (shape.size() > kMaxRank)
        return fail(ErrorCode::bad_input, "{} dimensions, at most {} are allowed", shape.size(), kMaxRank);
    uint64_t bits = bits_per_element;
    for (const uint64_t dim : shape) {
        if (dim > kMaxDim)
            return fail(ErrorCode::bad_input, "shape {} has a dimension over 2^40", shape_text(shape));
        if (__builtin_mul_overflow(bits, dim, &bits))
            return fail(ErrorCode::bad_input, "shape {} of {}-bit elements exceeds 2^64 bits", shape_text(shape),
                        bits_per_element);
    }
    if (bits % 8 != 0)
        return fail(ErrorCode::bad_input, "shape {} of {}-bit elements is no whole number of bytes", shape_text(shape),
                    bits_per_element);
    return bits / 8;
}

Result<uint64_t> checked_bytes(std::span<const uint64_t> shape, DType dtype)
{
    return checked_bytes(shape, static_cast<uint32_t>(dtype_bytes(dtype) * 8));
}

Result<SafetensorsHeader> parse_safetensors_header(std::span<const std::byte> file, std::string_view where,
                                                   const SafetensorsLimits& limits)
{
    SR_TRY(const std::string_view text, header_text(file, where, limits));
    SafetensorsHeader header;
    HeaderReader reader(header);
    SR_CHECK(parse_json_events(text, where, reader));
    header.data_begin = 8 + text.size();
    std::ranges::sort(header.tensors, {}, &TensorInfo::name);
    std::ranges::sort(header.unsupported, {}, &UnsupportedTensor::name);
    SR_CHECK(check_names(header, where));
    SR_CHECK(check_coverage(extents(header), file.size() - header.data_begin, where));
    return header;
}

} // namespace semrover
