// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json_fields.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

// note: dump() recurses, and a hostile file may nest without end
std::string value_text(const Json& value)
{
    if (value.is_structured() && !(value.is_array() && std::ranges::none_of(value, &Json::is_structured)))
        return fmt::format("an {}", value.type_name());
    return printable(json_text(value, -1, true), 60);
}

bool is_integer_in(const Json& value, uint32_t low, uint32_t high)
{
    return value.is_number_integer() && value.get<double>() >= low && value.get<double>() <= high;
}

} // namespace

JsonFields::JsonFields(const Json& object, std::string where) : object_(object), where_(std::move(where))
{
    if (!object.is_object())
        error_ = Error{ErrorCode::bad_input,
                       fmt::format("{}: expected a JSON object, found {}", where_, object.type_name())};
}

const Json* JsonFields::find(const char* name)
{
    if (!object_.is_object())
        return nullptr;
    seen_.insert(name);
    const auto found = object_.find(name);
    return found == object_.end() || found->is_null() ? nullptr : &*found;
}

void JsonFields::refuse(const char* name, std::string_view expected)
{
    if (error_)
        return;
    const auto found = object_.find(name);
    const std::string text = found == object_.end() ? "not given" : value_text(*found);
    error_ = Error{ErrorCode::bad_input, fmt::format("{}: {} is {}, supported: {}", where_, name, text, expected)};
}

void JsonFields::refuse_null(const char* name, std::string_view expected)
{
    if (object_.is_object() && object_.contains(name) && object_[name].is_null())
        refuse(name, expected);
}

void JsonFields::flag(const char* name, bool& out)
{
    if (const Json* value = find(name)) {
        if (!value->is_boolean())
            return refuse(name, "true or false");
        out = value->get<bool>();
    }
}

void JsonFields::optional_number(const char* name, double low, double high, std::optional<double>& out)
{
    double value = NAN;
    number(name, low, high, value);
    if (!std::isnan(value))
        out = value;
}

void JsonFields::integers(const char* name, size_t count, uint32_t low, uint32_t high, std::vector<uint32_t>& out)
{
    const Json* value = find(name);
    if (value && is_integer_in(*value, low, high)) {
        out.assign(count, value->get<uint32_t>());
    } else if (value && value->is_array() && value->size() == count &&
               std::ranges::all_of(*value, [&](const Json& v) { return is_integer_in(v, low, high); })) {
        out = value->get<std::vector<uint32_t>>();
    } else if (value) {
        refuse(name, fmt::format("a whole number from {} to {}, or a list of {} of them", low, high, count));
    }
}

void JsonFields::list(const char* name, size_t most, uint32_t low, uint32_t high, std::vector<uint32_t>& out)
{
    const Json* value = find(name);
    if (!value)
        return;
    if (!value->is_array() || value->empty() || value->size() > most ||
        !std::ranges::all_of(*value, [&](const Json& v) { return is_integer_in(v, low, high); }))
        return refuse(name, fmt::format("a list of 1 to {} whole numbers from {} to {}", most, low, high));
    out = value->get<std::vector<uint32_t>>();
}

void JsonFields::triples(const char* name, size_t most, double low, double high,
                         std::vector<std::array<double, 3>>& out)
{
    const Json* value = find(name);
    if (!value)
        return;
    const auto is_number = [&](const Json& v) { return v.is_number() && v >= low && v <= high; };
    const auto is_triple = [&](const Json& v) {
        return v.is_array() && v.size() == 3 && std::ranges::all_of(v, is_number);
    };
    if (!value->is_array() || value->empty() || value->size() > most || !std::ranges::all_of(*value, is_triple))
        return refuse(name, fmt::format("a list of 1 to {} lists of three numbers from {} to {}", most, low, high));
    out = value->get<std::vector<std::array<double, 3>>>();
}

void JsonFields::only(const char* name, const Json& supported)
{
    const Json* value = find(name);
    if (!value || *value == supported)
        return;
    if (value->is_array() && std::ranges::all_of(*value, [&](const Json& v) { return v == supported; }))
        return;
    refuse(name, supported.is_null() ? "none" : json_text(supported));
}

void JsonFields::ignore(std::initializer_list<const char*> names)
{
    for (const char* name : names)
        find(name);
}

Status JsonFields::finish(std::vector<std::string>& warnings) const
{
    if (error_)
        return tl::make_unexpected(*error_);
    for (const auto& item : object_.items())
        if (!item.key().starts_with('_') && !seen_.contains(item.key()))
            warnings.push_back(fmt::format("{}: unknown field \"{}\" is ignored", where_, printable(item.key(), 60)));
    return {};
}

Status check_keys(const Json& object, std::span<const std::string_view> known, std::string_view where)
{
    for (const auto& [key, value] : object.items())
        if (std::ranges::find(known, key) == known.end())
            return fail(ErrorCode::bad_input, "{}: unknown key {}", where, quote(key));
    return {};
}

Status check_array(const Json& value, std::string_view key, std::string_view where)
{
    if (value.is_array())
        return {};
    return fail(ErrorCode::bad_input, "{}: {}: expected an array, found {}", where, key, value.type_name());
}

} // namespace semrover
