// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/ply_reader.h"

#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace semrover {

namespace {

constexpr size_t kHeaderBytes = 1u << 20;
constexpr size_t kMaxElements = 64, kMaxColumns = 1024;

struct TypeFacts {
    std::string_view name, sized_name;
    size_t bytes;
    double low, high; // of an integer
};

// in the order of PlyType
constexpr std::array<TypeFacts, 8> kPlyTypes = {{
    {"char", "int8", 1, -128, 127},
    {"uchar", "uint8", 1, 0, 255},
    {"short", "int16", 2, -32768, 32767},
    {"ushort", "uint16", 2, 0, 65535},
    {"int", "int32", 4, -2147483648., 2147483647.},
    {"uint", "uint32", 4, 0, 4294967295.},
    {"float", "float32", 4, 0, 0},
    {"double", "float64", 8, 0, 0},
}};

const TypeFacts& facts(PlyType type)
{
    return kPlyTypes[static_cast<size_t>(type)];
}

std::optional<PlyType> type_of(std::string_view name)
{
    for (size_t i = 0; i < kPlyTypes.size(); ++i)
        if (name == kPlyTypes[i].name || name == kPlyTypes[i].sized_name)
            return static_cast<PlyType>(i);
    return std::nullopt;
}

std::vector<std::string_view> words_of(std::string_view line)
{
    std::vector<std::string_view> words;
    while (true) {
        const size_t first = line.find_first_not_of(" \t");
        if (first == std::string_view::npos)
            return words;
        line.remove_prefix(first);
        words.push_back(line.substr(0, std::min(line.find_first_of(" \t"), line.size())));
        line.remove_prefix(words.back().size());
    }
}

class HeaderParser {
  public:
    HeaderParser(std::string_view bytes, std::string_view where) : bytes_(bytes.substr(0, kHeaderBytes)), where_(where)
    {
    }

    Result<PlyHeader> parse();

  private:
    Status take_magic();
    Result<std::string_view> next_line();
    Status take_format(const std::vector<std::string_view>& words);
    Status take_element(const std::vector<std::string_view>& words);
    Status take_property(const std::vector<std::string_view>& words);
    Status close_element() const;

    template <typename... Args>
    tl::unexpected<Error> refuse(fmt::format_string<Args...> format, Args&&... args) const
    {
        return fail(ErrorCode::bad_input, "{}: line {}: {}", where_, header_.lines,
                    fmt::format(format, std::forward<Args>(args)...));
    }

    std::string_view bytes_, where_;
    std::string_view newline_ = "\n";
    bool has_format_ = false;
    PlyHeader header_;
};

// how the first line ends, all lines of the header end, so that a row may begin with any byte
Status HeaderParser::take_magic()
{
    header_.lines = 1;
    if (!bytes_.starts_with("ply") || bytes_.size() < 4 || (bytes_[3] != '\n' && bytes_[3] != '\r'))
        return refuse("expected 'ply', found {}", quote(bytes_.substr(0, std::min<size_t>(bytes_.size(), 16))));
    if (bytes_[3] == '\r')
        newline_ = bytes_.substr(3, 2) == "\r\n" ? "\r\n" : "\r";
    header_.bytes = 3 + newline_.size();
    return {};
}

Result<std::string_view> HeaderParser::next_line()
{
    ++header_.lines;
    const size_t end = bytes_.find(newline_, header_.bytes);
    if (end == std::string_view::npos)
        return bytes_.size() == kHeaderBytes ? refuse("the header exceeds {} bytes", kHeaderBytes)
                                             : refuse("the file ends within the header, expected 'end_header'");
    const std::string_view line = bytes_.substr(header_.bytes, end - header_.bytes);
    header_.bytes = end + newline_.size();
    return line;
}

Status HeaderParser::take_format(const std::vector<std::string_view>& words)
{
    if (has_format_)
        return refuse("a second format");
    if (words.size() != 3 || words[2] != "1.0")
        return refuse("expected 'format KIND 1.0', found {} words", words.size());
    if (words[1] == "ascii")
        header_.format = PlyFormat::ascii;
    else if (words[1] == "binary_little_endian")
        header_.format = PlyFormat::little_endian;
    else if (words[1] == "binary_big_endian")
        header_.format = PlyFormat::big_endian;
    else
        return refuse("expected the format ascii, binary_little_endian or binary_big_endian, found {}",
                      quote(words[1], 60));
    has_format_ = true;
    return {};
}

// rows of nothing have no size that a file could be too short for
Status HeaderParser::close_element() const
{
    if (!header_.elements.empty() && header_.elements.back().columns.empty() && header_.elements.back().rows)
        return refuse("element {} has {} rows but no properties", quote(header_.elements.back().name, 60),
                      header_.elements.back().rows);
    return {};
}

Status HeaderParser::take_element(const std::vector<std::string_view>& words)
{
    SR_CHECK(close_element());
    if (words.size() != 3)
        return refuse("expected 'element NAME ROWS', found {} words", words.size());
    PlyLayout element{std::string(words[1]), 0, {}, {}};
    const auto [end, error] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.rows);
    if (error != std::errc() || end != words[2].data() + words[2].size())
        return refuse("element {}: expected a number of rows, found {}", quote(words[1], 60), quote(words[2], 60));
    if (std::ranges::find(header_.elements, element.name, &PlyLayout::name) != header_.elements.end())
        return refuse("a second element {}", quote(words[1], 60));
    if (header_.elements.size() == kMaxElements)
        return refuse("more than {} elements", kMaxElements);
    header_.elements.push_back(std::move(element));
    return {};
}

Status HeaderParser::take_property(const std::vector<std::string_view>& words)
{
    if (header_.elements.empty())
        return refuse("a property before the first element");
    const bool list = words.size() > 1 && words[1] == "list";
    if (words.size() != (list ? 5u : 3u))
        return refuse("expected 'property TYPE NAME' or 'property list TYPE TYPE NAME', found {} words", words.size());
    PlyColumn column;
    for (size_t i = list ? 2 : 1; i + 1 < words.size(); ++i) {
        const std::optional<PlyType> type = type_of(words[i]);
        if (!type)
            return refuse("unknown type {}, expected char, uchar, short, ushort, int, uint, float or double",
                          quote(words[i], 60));
        if (list && i == 2) {
            if (is_float(*type))
                return refuse("a list's length of type {}, expected an integer", quote(words[i], 60));
            column.count = type;
        }
        column.type = *type;
    }
    PlyLayout& element = header_.elements.back();
    if (std::ranges::find(element.names, words.back()) != element.names.end())
        return refuse("element {} has a second property {}", quote(element.name, 60), quote(words.back(), 60));
    if (element.columns.size() == kMaxColumns)
        return refuse("element {} has more than {} properties", quote(element.name, 60), kMaxColumns);
    element.names.emplace_back(words.back());
    element.columns.push_back(column);
    return {};
}

Result<PlyHeader> HeaderParser::parse()
{
    SR_CHECK(take_magic());
    while (true) {
        SR_TRY(const std::string_view line, next_line());
        const std::vector<std::string_view> words = words_of(line);
        if (words.empty() || words[0] == "obj_info")
            continue;
        if (words[0] == "comment") {
            const size_t text = line.find("comment") + 7;
            header_.comments.emplace_back(line.substr(std::min(text + 1, line.size())));
        } else if (words[0] == "format") {
            SR_CHECK(take_format(words));
        } else if (words[0] == "element") {
            SR_CHECK(take_element(words));
        } else if (words[0] == "property") {
            SR_CHECK(take_property(words));
        } else if (words[0] == "end_header") {
            SR_CHECK(close_element());
            if (!has_format_)
                return refuse("the header has no format");
            return std::move(header_);
        } else {
            return refuse("unknown keyword {}", quote(words[0], 60));
        }
    }
}

} // namespace

size_t size_of(PlyType type)
{
    return facts(type).bytes;
}

bool is_float(PlyType type)
{
    return type == PlyType::f32 || type == PlyType::f64;
}

std::string_view name_of(PlyType type)
{
    return facts(type).name;
}

std::pair<double, double> range_of(PlyType type)
{
    return {facts(type).low, facts(type).high};
}

Result<PlyHeader> parse_ply_header(std::string_view bytes, std::string_view where)
{
    SR_TRY(const std::string_view text, text_after_mark(bytes, where));
    SR_TRY(PlyHeader header, HeaderParser(text, where).parse());
    header.bytes += bytes.size() - text.size();
    return header;
}

} // namespace semrover
