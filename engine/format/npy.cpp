// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/npy.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <optional>
#include <string>

namespace semrover {

namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr size_t kMaxDimensions = 8;
constexpr uint64_t kMaxBytes = uint64_t(1) << 40;

struct TypeCode {
    std::string_view code; // kind and size
    DType dtype;
};
constexpr TypeCode kTypes[] = {{"b1", DType::boolean}, {"i1", DType::i8},  {"u1", DType::u8},  {"i2", DType::i16},
                               {"u2", DType::u16},     {"i4", DType::i32}, {"u4", DType::u32}, {"i8", DType::i64},
                               {"u8", DType::u64},     {"f2", DType::f16}, {"f4", DType::f32}, {"f8", DType::f64}};

// a Python literal {'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }
class HeaderText {
  public:
    HeaderText(std::string_view text, std::string_view where) : text_(text), where_(where) {}

    Status parse(NpyHeader& header)
    {
        SR_CHECK(take('{'));
        bool seen[3] = {};
        while (!accept('}')) {
            SR_TRY(const std::string_view key, string());
            SR_CHECK(take(':'));
            const size_t field = key == "descr" ? 0 : key == "fortran_order" ? 1 : key == "shape" ? 2 : 3;
            if (field == 3 || seen[field])
                return refuse("a field {}{}", quote(key, 60), field == 3 ? "" : " twice");
            seen[field] = true;
            SR_CHECK(field == 0 ? type(header) : field == 1 ? order(header) : shape(header));
            if (!accept(',') && peek() != '}')
                return refuse("expected ',' or '}}' at byte {}", at_);
        }
        if (!seen[0] || !seen[1] || !seen[2])
            return refuse("expected descr, fortran_order and shape");
        if (peek())
            return refuse("text follows the header's end");
        return {};
    }

  private:
    template <typename... Args>
    tl::unexpected<Error> refuse(fmt::format_string<Args...> format, Args&&... args) const
    {
        return fail(ErrorCode::bad_input, "{}: .npy header: {}", where_,
                    fmt::format(format, std::forward<Args>(args)...));
    }

    char peek()
    {
        while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n'))
            ++at_;
        return at_ < text_.size() ? text_[at_] : '\0';
    }
    bool accept(char c)
    {
        const bool there = peek() == c;
        at_ += there;
        return there;
    }
    Status take(char c)
    {
        if (!accept(c))
            return refuse("expected '{}' at byte {}", c, at_);
        return {};
    }

    Result<std::string_view> string()
    {
        const char mark = peek();
        const size_t end = mark == '\'' || mark == '"' ? text_.find(mark, at_ + 1) : std::string_view::npos;
        if (end == std::string_view::npos)
            return refuse("expected a string at byte {}", at_);
        const std::string_view value = text_.substr(at_ + 1, end - at_ - 1);
        at_ = end + 1;
        return value;
    }

    Status type(NpyHeader& header)
    {
        if (peek() != '\'' && peek() != '"')
            return refuse("a structured type, expected bool, integers or floats");
        SR_TRY(const std::string_view descr, string());
        const std::string_view code = descr.substr(std::min<size_t>(descr.size(), 1));
        const auto known = std::ranges::find(kTypes, code, &TypeCode::code);
        if (descr.empty() || std::string_view("<>|=").find(descr[0]) == std::string_view::npos ||
            known == std::end(kTypes))
            return refuse("a type {}, expected bool, integers or floats", quote(descr, 60));
        header.dtype = known->dtype;
        header.big_endian = descr[0] == '>';
        return {};
    }

    Status order(NpyHeader& header)
    {
        peek();
        for (const auto& [word, value] : {std::pair{std::string_view("True"), true}, {"False", false}})
            if (text_.substr(at_).starts_with(word)) {
                at_ += word.size();
                header.fortran_order = value;
                return {};
            }
        return refuse("fortran_order: expected True or False");
    }

    Status shape(NpyHeader& header)
    {
        SR_CHECK(take('('));
        while (!accept(')')) {
            peek();
            uint64_t size = 0;
            const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), size);
            if (error != std::errc())
                return refuse("shape: expected a number at byte {}", at_);
            at_ = static_cast<size_t>(end - text_.data());
            if (header.shape.size() == kMaxDimensions)
                return refuse("shape: more than {} dimensions", kMaxDimensions);
            header.shape.push_back(size);
            if (!accept(',') && peek() != ')')
                return refuse("shape: expected ',' or ')' at byte {}", at_);
        }
        return {};
    }

    std::string_view text_, where_;
    size_t at_ = 0;
};

// column-major to row-major
std::vector<std::byte> transposed(const std::vector<std::byte>& data, const std::vector<uint64_t>& shape, size_t width)
{
    std::vector<std::byte> out(data.size());
    std::vector<uint64_t> index(shape.size(), 0), strides(shape.size(), 1);
    for (size_t a = 1; a < shape.size(); ++a)
        strides[a] = strides[a - 1] * shape[a - 1];
    for (size_t at = 0; at < data.size(); at += width) {
        uint64_t from = 0;
        for (size_t a = 0; a < shape.size(); ++a)
            from += index[a] * strides[a];
        std::memcpy(out.data() + at, data.data() + from * width, width);
        for (size_t a = shape.size(); a-- > 0 && ++index[a] == shape[a];)
            index[a] = 0;
    }
    return out;
}

} // namespace

Result<NpyHeader> parse_npy_header(std::string_view bytes, std::string_view where)
{
    if (!bytes.starts_with(kMagic) || bytes.size() < 8)
        return fail(ErrorCode::bad_input, "{}: no .npy array: it starts with {}", where, quote(bytes.substr(0, 8)));
    const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<unsigned char>(bytes[i])); };
    const size_t major = byte(6), length_bytes = major == 1 ? 2 : 4;
    if (major < 1 || major > 3 || byte(7) != 0)
        return fail(ErrorCode::bad_input, "{}: .npy version {}.{}, expected 1.0, 2.0 or 3.0", where, major, byte(7));
    if (bytes.size() < 8 + length_bytes)
        return fail(ErrorCode::bad_input, "{}: the .npy header is cut short", where);
    size_t length = 0;
    for (size_t i = 0; i < length_bytes; ++i)
        length |= byte(8 + i) << (8 * i);
    const size_t begin = 8 + length_bytes;
    if (length > kNpyHeaderBytes - begin)
        return fail(ErrorCode::bad_input, "{}: a .npy header of {} bytes, at most {} are allowed", where, length,
                    kNpyHeaderBytes - begin);
    if (bytes.size() < begin + length)
        return fail(ErrorCode::bad_input, "{}: the .npy header is cut short", where);
    NpyHeader header;
    SR_CHECK(HeaderText(bytes.substr(begin, length), where).parse(header));
    header.bytes = begin + length;
    // a zero anywhere makes it empty, but the other sizes are still checked
    uint64_t product = dtype_bytes(header.dtype);
    for (const uint64_t size : header.shape) {
        if (size && product > kMaxBytes / size)
            return fail(ErrorCode::bad_input, "{}: an absurd .npy shape: {} elements along an axis", where, size);
        product *= std::max<uint64_t>(size, 1);
    }
    header.data_bytes = std::ranges::find(header.shape, 0u) == header.shape.end() ? product : 0;
    return header;
}

NpyArray decode_npy(const NpyHeader& header, std::vector<std::byte> data)
{
    SR_ASSERT(data.size() == header.data_bytes, "{} bytes for an array of {}", data.size(), header.data_bytes);
    const size_t width = dtype_bytes(header.dtype);
    if (header.big_endian)
        for (size_t at = 0; at < data.size(); at += width)
            std::reverse(data.begin() + static_cast<ptrdiff_t>(at), data.begin() + static_cast<ptrdiff_t>(at + width));
    if (header.fortran_order && header.shape.size() > 1)
        data = transposed(data, header.shape, width);
    return {header.dtype, header.shape, std::move(data)};
}

std::vector<std::byte> encode_npy(const NpyArray& array)
{
    const auto known = std::ranges::find(kTypes, array.dtype, &TypeCode::dtype);
    SR_ASSERT(known != std::end(kTypes), "numpy has no type {}", dtype_name(array.dtype));
    std::string shape;
    for (const uint64_t size : array.shape)
        shape += fmt::format("{}, ", size);
    if (array.shape.size() > 1)
        shape.resize(shape.size() - 2);
    else if (!shape.empty())
        shape.pop_back(); // "(5,)"
    std::string text = fmt::format("{{'descr': '{}{}', 'fortran_order': False, 'shape': ({}), }}",
                                   dtype_bytes(array.dtype) == 1 ? '|' : '<', known->code, shape);
    text.append(63 - (10 + text.size()) % 64, ' '); // the data begins at a multiple of 64
    text += '\n';
    std::string head(kMagic);
    head += {'\1', '\0', static_cast<char>(text.size() & 255), static_cast<char>(text.size() >> 8)};
    head += text;
    std::vector<std::byte> bytes(head.size() + array.data.size());
    std::memcpy(bytes.data(), head.data(), head.size());
    std::ranges::copy(array.data, bytes.begin() + static_cast<ptrdiff_t>(head.size()));
    return bytes;
}

} // namespace semrover
