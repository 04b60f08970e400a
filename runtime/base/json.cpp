// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json.h"

#include "runtime/base/quote.h"

#include <optional>
#include <vector>

namespace semrover {

namespace {

// builds the value; one frame per open array or object
class ValueBuilder : public JsonEvents {
  public:
    explicit ValueBuilder(const JsonLimits& limits) : limits_(limits) {}

    bool null() override { return place(Json()) != nullptr; }
    bool boolean(bool value) override { return place(Json(value)) != nullptr; }
    bool number_integer(number_integer_t value) override { return place(Json(value)) != nullptr; }
    bool number_unsigned(number_unsigned_t value) override { return place(Json(value)) != nullptr; }
    bool number_float(number_float_t value, const string_t&) override { return place(Json(value)) != nullptr; }
    bool string(string_t& value) override { return place(Json(std::move(value))) != nullptr; }
    bool start_object(size_t) override { return open(Json::object()); }
    bool start_array(size_t) override { return open(Json::array()); }
    bool end_object() override { return close(); }
    bool end_array() override { return close(); }

    bool key(string_t& name) override
    {
        if (open_.back()->contains(name))
            return refuse(fmt::format("key {} appears twice", quote(name)));
        key_ = std::move(name);
        return true;
    }

    bool whole() const { return open_.empty(); } // no array or object is open
    Json root;

  private:
    Json* place(Json&& value)
    {
        if (++values_ > limits_.values) {
            refuse(fmt::format("more than {} values", limits_.values));
            return nullptr;
        }
        if (open_.empty()) {
            root = std::move(value);
            return &root;
        }
        Json& parent = *open_.back();
        if (parent.is_array()) {
            parent.push_back(std::move(value));
            return &parent.back();
        }
        return &(parent[key_] = std::move(value));
    }

    bool open(Json&& value)
    {
        if (open_.size() >= limits_.depth)
            return refuse(fmt::format("nested deeper than {}", limits_.depth));
        if (++containers_ > limits_.containers)
            return refuse(fmt::format("more than {} arrays and objects", limits_.containers));
        Json* placed = place(std::move(value));
        if (placed)
            open_.push_back(placed); // stays valid: the parent grows only after this one is closed
        return placed != nullptr;
    }

    bool close()
    {
        open_.pop_back();
        return true;
    }

    const JsonLimits& limits_;
    std::vector<Json*> open_;
    std::string key_;
    uint64_t values_ = 0, containers_ = 0;
};

// gives the values of an array to a function one by one
class RecordEvents : public JsonEvents {
  public:
    using Record = std::function<Status(const Json&, size_t)>;
    RecordEvents(const JsonLimits& limits, const Record& record) : limits_(limits), record_(record) {}

    bool null() override
    {
        return pass([](ValueBuilder& b) { return b.null(); });
    }
    bool boolean(bool value) override
    {
        return pass([=](ValueBuilder& b) { return b.boolean(value); });
    }
    bool number_integer(number_integer_t value) override
    {
        return pass([=](ValueBuilder& b) { return b.number_integer(value); });
    }
    bool number_unsigned(number_unsigned_t value) override
    {
        return pass([=](ValueBuilder& b) { return b.number_unsigned(value); });
    }
    bool number_float(number_float_t value, const string_t& text) override
    {
        return pass([&](ValueBuilder& b) { return b.number_float(value, text); });
    }
    bool string(string_t& value) override
    {
        return pass([&](ValueBuilder& b) { return b.string(value); });
    }
    bool key(string_t& name) override
    {
        return pass([&](ValueBuilder& b) { return b.key(name); });
    }
    bool start_object(size_t size) override
    {
        return pass([=](ValueBuilder& b) { return b.start_object(size); });
    }
    bool end_object() override
    {
        return pass([](ValueBuilder& b) { return b.end_object(); });
    }
    bool start_array(size_t size) override
    {
        if (!begun_)
            return begun_ = true;
        return pass([=](ValueBuilder& b) { return b.start_array(size); });
    }
    bool end_array() override
    {
        return !builder_ || pass([](ValueBuilder& b) { return b.end_array(); });
    }

    Status result;

  private:
    template <typename Event>
    bool pass(const Event& event)
    {
        if (!begun_)
            return refuse("expected an array");
        if (!builder_)
            builder_.emplace(limits_);
        if (!event(*builder_))
            return refuse(fmt::format("value {}: {}", number_, builder_->refusal()));
        if (!builder_->whole())
            return true;
        result = record_(builder_->root, number_++);
        builder_.reset();
        return result.has_value();
    }

    const JsonLimits& limits_;
    const Record& record_;
    std::optional<ValueBuilder> builder_;
    size_t number_ = 0;
    bool begun_ = false;
};

} // namespace

bool JsonEvents::refuse(std::string reason)
{
    refusal_ = std::move(reason);
    return false;
}

bool JsonEvents::parse_error(size_t position, const std::string&, const nlohmann::detail::exception& e)
{
    // "[json.exception.parse_error.101] parse error at line 1, column 5: syntax error ..."; the last token may be long
    std::string_view what = e.what();
    if (const size_t end = what.find("] "); end != std::string_view::npos)
        what.remove_prefix(end + 2);
    if (const size_t token = what.find("; last read: "); token != std::string_view::npos)
        what = what.substr(0, token);
    return refuse(fmt::format("not valid JSON at byte {}: {}", position, printable(what)));
}

Status parse_json_events(std::string_view text, std::string_view where, JsonEvents& events)
{
    // note: nlohmann skips a byte order mark and takes NUL for the end of the input; both would let bytes hide
    if (text.starts_with("\xef\xbb\xbf"))
        return fail(ErrorCode::bad_input, "{}: starts with a byte order mark, expected plain UTF-8", where);
    if (const size_t nul = text.find('\0'); nul != std::string_view::npos)
        return fail(ErrorCode::bad_input, "{}: NUL at byte {} of the JSON text", where, nul);
    if (!Json::sax_parse(text.begin(), text.end(), &events, Json::input_format_t::json, true))
        return fail(ErrorCode::bad_input, "{}: {}", where, events.refusal());
    return {};
}

Result<Json> parse_json(std::string_view text, std::string_view where, const JsonLimits& limits)
{
    if (text.size() > limits.bytes)
        return fail(ErrorCode::bad_input, "{}: expected at most {} bytes of JSON, found {}", where, limits.bytes,
                    text.size());
    ValueBuilder builder(limits);
    SR_CHECK(parse_json_events(text, where, builder));
    return std::move(builder.root);
}

Result<Json> read_json(const Path& path, const JsonLimits& limits)
{
    SR_TRY(const std::string text, read_text_file(path, limits.bytes));
    return parse_json(text, quote_path(path), limits);
}

Status parse_json_records(std::string_view text, std::string_view where, const JsonLimits& limits,
                          const std::function<Status(const Json& value, size_t number)>& record)
{
    if (text.size() > limits.bytes)
        return fail(ErrorCode::bad_input, "{}: expected at most {} bytes of JSON, found {}", where, limits.bytes,
                    text.size());
    RecordEvents events(limits, record);
    const Status parsed = parse_json_events(text, where, events);
    SR_CHECK(std::move(events.result));
    return parsed;
}

Json short_number(float value)
{
    return std::strtod(fmt::format("{}", value).c_str(), nullptr);
}

} // namespace semrover
