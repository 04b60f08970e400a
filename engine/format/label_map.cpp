// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/label_map.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <charconv>

namespace semrover {

namespace {

constexpr size_t kMostListed = 20;

std::optional<uint32_t> number_of_key(std::string_view text)
{
    uint32_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        return std::nullopt;
    return value;
}

Result<uint8_t> target_of(const Json& value, const std::string& where)
{
    if (value.is_null())
        return kLeftOut;
    if (value.is_number_unsigned() && value.get<uint64_t>() < kClassCount)
        return value.get<uint8_t>();
    if (value.is_string())
        if (const auto label = class_of_name(value.get<std::string>()))
            return *label;
    return fail(ErrorCode::bad_input, "{}: expected a class (name or 0 to {}) or null, found {}", where,
                kClassCount - 1, printable(value.dump(-1, ' ', true), 60));
}

} // namespace

LabelMap::LabelMap(std::span<const SourceLabel> labels)
{
    for (const SourceLabel& label : labels)
        set(label.number, std::string(label.name), label.target);
}

LabelMap LabelMap::identity()
{
    LabelMap map;
    for (uint8_t i = 0; i < kClassCount; ++i)
        map.set(i, std::string(kPalette[i].name), i);
    return map;
}

void LabelMap::set(uint32_t source, std::string name, std::optional<uint8_t> target)
{
    entries_[source] = {std::move(name), target, 0};
}

Status LabelMap::apply(const Path& file)
{
    SR_TRY(const Json json, read_json(file));
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object of source label to class, found {}", quote_path(file),
                    json.type_name());
    for (const auto& [key, value] : json.items()) {
        const std::string where = fmt::format("{}: {}", quote_path(file), quote(key, 60));
        SR_TRY(const uint8_t target, target_of(value, where));
        if (const auto number = number_of_key(key)) {
            entries_[*number].target = target;
            continue;
        }
        bool found = false;
        for (auto& [number, entry] : entries_)
            if (same_class_name(entry.name, key)) {
                entry.target = target;
                found = true;
            }
        if (!found)
            return fail(ErrorCode::bad_input, "{}: the source has no label of that name", where);
    }
    return {};
}

uint8_t LabelMap::operator()(uint32_t source, uint64_t count)
{
    Entry& entry = entries_[source];
    entry.count += count;
    return entry.target.value_or(kLeftOut);
}

Status LabelMap::check(std::string_view where, std::string_view things, std::string_view advice) const
{
    std::string list;
    size_t unknown = 0;
    for (const auto& [number, entry] : entries_)
        if (entry.count && !entry.target && ++unknown <= kMostListed)
            list += fmt::format("{}{}{} ({} {})", list.empty() ? "" : ", ", number,
                                entry.name.empty() ? "" : " " + printable(entry.name, 60), entry.count, things);
    if (unknown == 0)
        return {};
    if (unknown > kMostListed)
        list += fmt::format(" and {} more", unknown - kMostListed);
    return fail(ErrorCode::bad_input, "{}: unknown labels: {}; {}", where, list, advice);
}

std::vector<std::string> LabelMap::left_out(std::string_view things) const
{
    std::vector<std::string> lines;
    for (const auto& [number, entry] : entries_)
        if (entry.count && entry.target == kLeftOut)
            lines.push_back(fmt::format("{} {} of label {}{} are left out", entry.count, things, number,
                                        entry.name.empty() ? "" : fmt::format(" ({})", printable(entry.name, 60))));
    return lines;
}

uint64_t LabelMap::dropped() const
{
    uint64_t sum = 0;
    for (const auto& [number, entry] : entries_)
        if (entry.target == kLeftOut)
            sum += entry.count;
    return sum;
}

} // namespace semrover
