// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/ply_reader.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

namespace semrover {

static_assert(std::endian::native == std::endian::little);

namespace {

bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

template <typename T>
double loaded(const char* bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return static_cast<double>(value);
}

double loaded(PlyType type, const char* bytes)
{
    switch (type) {
    case PlyType::i8:
        return loaded<int8_t>(bytes);
    case PlyType::u8:
        return loaded<uint8_t>(bytes);
    case PlyType::i16:
        return loaded<int16_t>(bytes);
    case PlyType::u16:
        return loaded<uint16_t>(bytes);
    case PlyType::i32:
        return loaded<int32_t>(bytes);
    case PlyType::u32:
        return loaded<uint32_t>(bytes);
    case PlyType::f32:
        return loaded<float>(bytes);
    case PlyType::f64:
        break;
    }
    return loaded<double>(bytes);
}

// an integer type's own bytes are the lowest ones of a wider one
template <typename T>
std::array<char, 8> stored(double value)
{
    std::array<char, 8> bytes{};
    const T typed = static_cast<T>(value);
    std::memcpy(bytes.data(), &typed, sizeof(T));
    return bytes;
}

double decode(PlyType type, const char* bytes, bool big_endian)
{
    std::array<char, 8> raw;
    std::memcpy(raw.data(), bytes, size_of(type));
    if (big_endian)
        std::reverse(raw.begin(), raw.begin() + ptrdiff_t(size_of(type)));
    return loaded(type, raw.data());
}

template <typename T>
bool parse_number(std::string_view word, double& out)
{
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    out = static_cast<double>(value);
    return error == std::errc() && end == word.data() + word.size();
}

// integers may be written as 128.0
bool parse_value(PlyType type, std::string_view word, double& out)
{
    if (word.starts_with('+'))
        word.remove_prefix(1);
    if (type == PlyType::f32)
        return parse_number<float>(word, out);
    if (type == PlyType::f64)
        return parse_number<double>(word, out);
    const auto [low, high] = range_of(type);
    return parse_number<double>(word, out) && out >= low && out <= high && out == std::floor(out);
}

class BodyReader {
  public:
    BodyReader(std::string_view bytes, const PlyHeader& header, std::string where)
        : bytes_(bytes), at_(header.bytes), line_(header.lines), big_endian_(header.format == PlyFormat::big_endian),
          where_(std::move(where))
    {
    }

    Status read_text(PlyElement& element, const std::vector<PlyColumn>& columns);
    Status read_binary(PlyElement& element, const std::vector<PlyColumn>& columns);
    Status finish() const;

  private:
    Status check_rows(const PlyElement& element, uint64_t row_bytes) const;
    void read_columns(PlyElement& element, const std::vector<PlyColumn>& columns, uint64_t row_bytes);
    Status read_binary_row(PlyElement& element, const std::vector<PlyColumn>& columns, uint64_t row);
    Status read_text_row(std::string_view text, PlyElement& element, const std::vector<PlyColumn>& columns);
    std::string_view next_line();
    Status end_list(PlyProperty& property) const;
    uint64_t left() const { return bytes_.size() - at_; }

    std::string_view bytes_;
    size_t at_;
    uint64_t line_;
    bool big_endian_;
    std::string where_;
};

Status BodyReader::check_rows(const PlyElement& element, uint64_t row_bytes) const
{
    if (element.rows > left() / row_bytes)
        return fail(ErrorCode::bad_input, "{}: element {} has {} rows of at least {} bytes, but {} bytes are left",
                    where_, quote(element.name, 60), element.rows, row_bytes, left());
    return {};
}

Status BodyReader::end_list(PlyProperty& property) const
{
    if (property.values.size() > std::numeric_limits<uint32_t>::max())
        return fail(ErrorCode::bad_input, "{}: {}: more than 2^32 values in lists", where_, quote(property.name, 60));
    property.starts.push_back(static_cast<uint32_t>(property.values.size()));
    return {};
}

std::string_view BodyReader::next_line()
{
    const size_t end = std::min(bytes_.find_first_of("\r\n", at_), bytes_.size());
    const std::string_view line = bytes_.substr(at_, end - at_);
    const bool two = bytes_.substr(end, 2) == "\r\n";
    at_ = std::min(end + (two ? 2 : 1), bytes_.size());
    ++line_;
    return line;
}

Status BodyReader::read_text_row(std::string_view text, PlyElement& element, const std::vector<PlyColumn>& columns)
{
    const auto next = [&](PlyType type, const std::string& name, double& value) -> Status {
        while (!text.empty() && is_blank(text.front()))
            text.remove_prefix(1);
        const std::string_view word = text.substr(0, std::min(text.find_first_of(" \t"), text.size()));
        if (word.empty())
            return fail(ErrorCode::bad_input, "{}: line {}: the row ends before {}", where_, line_, quote(name, 60));
        if (!parse_value(type, word, value))
            return fail(ErrorCode::bad_input, "{}: line {}: {}: expected a number of type {}, found {}", where_, line_,
                        quote(name, 60), name_of(type), quote(word, 60));
        text.remove_prefix(word.size());
        return {};
    };
    for (size_t i = 0; i < columns.size(); ++i) {
        PlyProperty& property = element.properties[i];
        double value = 0, length = 1;
        if (property.is_list) {
            SR_CHECK(next(*columns[i].count, property.name, length));
            if (length < 0 || length > static_cast<double>(text.size()))
                return fail(ErrorCode::bad_input, "{}: line {}: {}: a list of {} values on a line of {} bytes", where_,
                            line_, quote(property.name, 60), length, text.size());
        }
        for (uint64_t j = 0; j < static_cast<uint64_t>(length); ++j) {
            SR_CHECK(next(columns[i].type, property.name, value));
            property.values.append(value);
        }
        if (property.is_list)
            SR_CHECK(end_list(property));
    }
    if (text.find_first_not_of(" \t") != std::string_view::npos)
        return fail(ErrorCode::bad_input, "{}: line {}: more values than properties: {}", where_, line_,
                    quote(text.substr(text.find_first_not_of(" \t")), 60));
    return {};
}

Status BodyReader::read_text(PlyElement& element, const std::vector<PlyColumn>& columns)
{
    if (element.rows)
        SR_CHECK(check_rows(element, std::max<size_t>(2 * columns.size() - 1, 1)));
    for (uint64_t row = 0; row < element.rows;) {
        if (at_ == bytes_.size())
            return fail(ErrorCode::bad_input, "{}: line {}: the file ends at row {} of {} of element {}", where_, line_,
                        row, element.rows, quote(element.name, 60));
        const std::string_view text = next_line();
        if (text.find_first_not_of(" \t") == std::string_view::npos)
            continue;
        SR_CHECK(read_text_row(text, element, columns));
        ++row;
    }
    return {};
}

// rows of one size, a column at a time
void BodyReader::read_columns(PlyElement& element, const std::vector<PlyColumn>& columns, uint64_t row_bytes)
{
    uint64_t offset = 0;
    for (size_t i = 0; i < columns.size(); ++i) {
        PlyValues& values = element.properties[i].values;
        values.reserve(element.rows);
        const char* first = bytes_.data() + at_ + offset;
        for (uint64_t row = 0; row < element.rows; ++row)
            values.append(first + row * row_bytes, big_endian_);
        offset += size_of(columns[i].type);
    }
    at_ += element.rows * row_bytes;
}

Status BodyReader::read_binary_row(PlyElement& element, const std::vector<PlyColumn>& columns, uint64_t row)
{
    for (size_t i = 0; i < columns.size(); ++i) {
        PlyProperty& property = element.properties[i];
        const auto [type, count] = columns[i];
        uint64_t length = 1;
        if (property.is_list) {
            double value = -1;
            if (left() >= size_of(*count)) {
                value = decode(*count, bytes_.data() + at_, big_endian_);
                at_ += size_of(*count);
            }
            if (value < 0 || value > static_cast<double>(left() / size_of(type)))
                return fail(ErrorCode::bad_input,
                            "{}: row {} of element {}: {}: a list of {} values, {} bytes are left", where_, row,
                            quote(element.name, 60), quote(property.name, 60), value, left());
            length = static_cast<uint64_t>(value);
        }
        if (left() / size_of(type) < length)
            return fail(ErrorCode::bad_input, "{}: row {} of element {}: the file ends before {}", where_, row,
                        quote(element.name, 60), quote(property.name, 60));
        for (uint64_t j = 0; j < length; ++j, at_ += size_of(type))
            property.values.append(bytes_.data() + at_, big_endian_);
        if (property.is_list)
            SR_CHECK(end_list(property));
    }
    return {};
}

Status BodyReader::read_binary(PlyElement& element, const std::vector<PlyColumn>& columns)
{
    uint64_t row_bytes = 0; // a list may be empty
    bool lists = false;
    for (const auto& [type, count] : columns) {
        row_bytes += size_of(count.value_or(type));
        lists |= count.has_value();
    }
    if (element.rows)
        SR_CHECK(check_rows(element, row_bytes));
    if (!lists) {
        read_columns(element, columns, row_bytes);
        return {};
    }
    for (uint64_t row = 0; row < element.rows; ++row)
        SR_CHECK(read_binary_row(element, columns, row));
    return {};
}

Status BodyReader::finish() const
{
    if (!std::ranges::all_of(bytes_.substr(at_), is_blank))
        return fail(ErrorCode::bad_input, "{}: {} bytes follow the last element", where_, left());
    return {};
}

} // namespace

double PlyValues::operator[](size_t i) const
{
    return loaded(type_, bytes_.data() + i * size_of(type_));
}

void PlyValues::append(const char* bytes, bool big_endian)
{
    const size_t at = bytes_.size();
    bytes_.insert(bytes_.end(), bytes, bytes + size_of(type_));
    if (big_endian)
        std::reverse(bytes_.begin() + ptrdiff_t(at), bytes_.end());
}

void PlyValues::append(double value)
{
    const std::array<char, 8> raw = type_ == PlyType::f32   ? stored<float>(value)
                                    : type_ == PlyType::f64 ? stored<double>(value)
                                                            : stored<int64_t>(value);
    append(raw.data(), false);
}

const PlyProperty* PlyElement::find(std::string_view property) const
{
    const auto found = std::ranges::find(properties, property, &PlyProperty::name);
    return found == properties.end() ? nullptr : &*found;
}

const PlyElement* PlyFile::find(std::string_view element) const
{
    const auto found = std::ranges::find(elements, element, &PlyElement::name);
    return found == elements.end() ? nullptr : &*found;
}

Result<PlyFile> read_ply(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view bytes(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    SR_TRY(PlyHeader header, parse_ply_header(bytes, where));
    BodyReader body(bytes, header, where);
    PlyFile ply{std::move(header.comments), {}, bytes.size()};
    for (PlyLayout& layout : header.elements) {
        PlyElement element{std::move(layout.name), layout.rows, {}};
        for (size_t i = 0; i < layout.columns.size(); ++i) {
            const bool list = layout.columns[i].count.has_value();
            const PlyType type = layout.columns[i].type;
            element.properties.push_back({std::move(layout.names[i]), is_float(type), list, PlyValues(type), {}});
            if (list)
                element.properties.back().starts.push_back(0);
        }
        SR_CHECK(header.format == PlyFormat::ascii ? body.read_text(element, layout.columns)
                                                   : body.read_binary(element, layout.columns));
        ply.elements.push_back(std::move(element));
    }
    SR_CHECK(body.finish());
    return ply;
}

} // namespace semrover
