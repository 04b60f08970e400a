// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/job_tree.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

// note: its assertions are about what files say ("[{"), and the checks behind them give the error
#undef NDEBUG
#define TOML_ASSERT(condition) static_cast<void>(0)
#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

namespace semrover {

namespace {

constexpr uint64_t kMostBytes = 16u << 20;

// as an option takes it
std::string number_text(double value)
{
    return fmt::format("{}", value);
}

// TOML

Result<JobValue> from_toml(const toml::node& node, const Path& path);

tl::unexpected<Error> no_meaning(const Path& path, const JobValue& at, std::string_view what)
{
    return fail(ErrorCode::bad_input, "{}:{}:{}: {} has no meaning in a job", quote_path(path), at.line, at.column,
                what);
}

Status fill_table(JobValue& value, const toml::table& table, const Path& path)
{
    value.kind = JobValue::Kind::table;
    for (const auto& [key, child] : table) {
        SR_TRY(JobValue member, from_toml(child, path));
        member.line = key.source().begin.line;
        member.column = key.source().begin.column;
        value.members.emplace_back(key.str(), std::move(member));
    }
    std::ranges::sort(value.members, {}, [](const auto& m) { return std::pair(m.second.line, m.second.column); });
    return {};
}

Result<JobValue> from_toml(const toml::node& node, const Path& path)
{
    JobValue value;
    value.line = node.source().begin.line;
    value.column = node.source().begin.column;
    if (const auto* table = node.as_table()) {
        SR_CHECK(fill_table(value, *table, path));
    } else if (const auto* list = node.as_array()) {
        value.kind = JobValue::Kind::list;
        for (const toml::node& item : *list) {
            SR_TRY(value.items.emplace_back(), from_toml(item, path));
        }
    } else if (const auto* text = node.as_string()) {
        value.kind = JobValue::Kind::text;
        value.text = text->get();
    } else if (const auto* integer = node.as_integer()) {
        value.kind = JobValue::Kind::integer;
        value.text = std::to_string(integer->get());
    } else if (const auto* number = node.as_floating_point()) {
        value.kind = JobValue::Kind::number;
        value.text = number_text(number->get());
    } else if (const auto* boolean = node.as_boolean()) {
        value.kind = JobValue::Kind::boolean;
        value.text = boolean->get() ? "true" : "false";
    } else {
        return no_meaning(path, value, "a date or time");
    }
    return value;
}

Result<JobValue> parse_toml(std::string_view text, const Path& path)
{
    const toml::parse_result parsed = toml::parse(text, path.string());
    if (!parsed)
        return fail(ErrorCode::bad_input, "{}:{}:{}: {}", quote_path(path), parsed.error().source().begin.line,
                    parsed.error().source().begin.column, printable(parsed.error().description()));
    return from_toml(parsed.table(), path);
}

// JSON

// counts what the parser has read
struct CountingIterator {
    using value_type = char;
    using difference_type = std::ptrdiff_t;
    using pointer = const char*;
    using reference = const char&;
    using iterator_category = std::input_iterator_tag;

    const char* at = nullptr;
    const char** furthest = nullptr;

    const char& operator*() const { return *at; }
    CountingIterator& operator++()
    {
        ++at;
        if (furthest)
            *furthest = std::max(*furthest, at);
        return *this;
    }
    bool operator==(const CountingIterator& other) const { return at == other.at; }
    bool operator!=(const CountingIterator& other) const { return at != other.at; }
};

class TreeEvents : public JsonEvents {
  public:
    TreeEvents(const char* begin, const char** read) : begin_(begin), read_(read) { open_.push_back(&root_); }

    bool null() override { return refuse("null"); }
    bool boolean(bool value) override { return add(JobValue::Kind::boolean, value ? "true" : "false"); }
    bool number_integer(number_integer_t value) override { return add(JobValue::Kind::integer, std::to_string(value)); }
    bool number_unsigned(number_unsigned_t value) override
    {
        return add(JobValue::Kind::integer, std::to_string(value));
    }
    bool number_float(number_float_t value, const string_t&) override
    {
        return add(JobValue::Kind::number, number_text(value));
    }
    bool string(string_t& value) override { return add(JobValue::Kind::text, value); }
    bool start_object(size_t) override { return enter(JobValue::Kind::table); }
    bool start_array(size_t) override { return enter(JobValue::Kind::list); }
    bool end_object() override { return leave(); }
    bool end_array() override { return leave(); }
    bool key(string_t& name) override
    {
        JobValue value;
        place(value, name.size() + 2);
        open_.back()->members.emplace_back(name, std::move(value));
        return true;
    }

    JobValue& root() { return root_.items.front(); }
    uint32_t line() const { return lines_ + 1; }

  private:
    // of a token of that many bytes, which was just read
    void place(JobValue& value, size_t bytes)
    {
        const char* at = std::max(begin_, *read_ - std::ptrdiff_t(bytes));
        for (; counted_ < at; ++counted_)
            if (*counted_ == '\n') {
                ++lines_;
                line_begin_ = counted_ + 1;
            }
        value.line = lines_ + 1;
        value.column = uint32_t(std::max<std::ptrdiff_t>(at - line_begin_, 0)) + 1;
    }
    JobValue& next(size_t bytes)
    {
        JobValue& open = *open_.back();
        if (open.kind == JobValue::Kind::table && open_.size() > 1)
            return open.members.back().second; // its key's place
        JobValue& item = open.items.emplace_back();
        place(item, bytes);
        return item;
    }
    bool add(JobValue::Kind kind, std::string text)
    {
        JobValue& value = next(text.size());
        value.kind = kind;
        value.text = std::move(text);
        return true;
    }
    bool enter(JobValue::Kind kind)
    {
        JobValue& value = next(1);
        value.kind = kind;
        open_.push_back(&value);
        return true;
    }
    bool leave()
    {
        open_.pop_back();
        return true;
    }

    const char *begin_, **read_;
    const char *counted_ = begin_, *line_begin_ = begin_;
    uint32_t lines_ = 0;
    JobValue root_{.kind = JobValue::Kind::list};
    std::vector<JobValue*> open_; // note: what is open is the last of its parent, which grows only when it is closed
};

Result<JobValue> parse_json_tree(std::string_view text, const Path& path)
{
    SR_CHECK(parse_json(text, quote_path(path)).map([](const Json&) {})); // syntax, limits, keys that stand twice
    const char* read = text.data();
    TreeEvents events(text.data(), &read);
    const CountingIterator begin{text.data(), &read}, end{text.data() + text.size(), nullptr};
    if (!Json::sax_parse(begin, end, &events))
        return fail(ErrorCode::bad_input, "{}:{}: {} has no meaning in a job", quote_path(path), events.line(),
                    events.refusal());
    return std::move(events.root());
}

} // namespace

const JobValue* JobValue::find(std::string_view key) const
{
    const auto found = std::ranges::find(members, key, [](const auto& m) { return std::string_view(m.first); });
    return found == members.end() ? nullptr : &found->second;
}

std::string_view kind_name(JobValue::Kind kind)
{
    constexpr std::string_view kNames[] = {"a text", "an integer", "a number", "true or false", "a list", "a table"};
    return kNames[size_t(kind)];
}

Result<JobValue> read_job_tree(const Path& path)
{
    SR_TRY(const std::string text, read_text_file(path, kMostBytes));
    SR_TRY(JobValue tree, path.extension() == ".json" ? parse_json_tree(text, path) : parse_toml(text, path));
    if (tree.kind != JobValue::Kind::table)
        return fail(ErrorCode::bad_input, "{}: expected a table, found {}", quote_path(path), kind_name(tree.kind));
    return tree;
}

} // namespace semrover
