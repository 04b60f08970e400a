// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/label_map.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kMostListed = 20;

} // namespace

std::vector<SourceLabel> source_labels(const LabelTable& whole)
{
    std::vector<SourceLabel> labels;
    for (const LabelTable::Label& label : whole.labels)
        labels.push_back({label.number.value(), label.name, label.target});
    return labels;
}

LabelMap::LabelMap(std::span<const SourceLabel> labels)
{
    for (const SourceLabel& label : labels)
        set(label.number, std::string(label.name), label.target);
}

LabelMap LabelMap::identity()
{
    LabelMap map;
    map.numbers_ = true;
    for (uint8_t i = 0; i < kClassCount; ++i)
        map.set(i, std::string(kPalette[i].name), i);
    return map;
}

Result<LabelMap> LabelMap::of(std::string_view table)
{
    LabelMap map;
    map.numbers_ = true;
    SR_CHECK(map.apply(Path(table)));
    return map;
}

Result<LabelMap> LabelMap::of_column(const LabelColumn& column, bool ours, const Path& map)
{
    LabelMap result;
    const bool foreign = !ours && !column.table.empty();
    if (!foreign) {
        result = identity();
        for (auto& [number, entry] : result.entries_)
            entry.assumed = !ours;
    }
    if (foreign) {
        SR_CHECK(result.apply(Path(column.table)));
        if (!map.empty())
            for (auto& [number, entry] : result.entries_)
                entry.target.reset(); // the name stays, for maps that use it
    }
    if (!map.empty())
        SR_CHECK(result.apply(map));
    result.refused_ = foreign && map.empty();
    result.numbers_ = true;
    result.column_ = column;
    return result;
}

Result<LabelMap> LabelMap::of_array(const Path& map)
{
    LabelMap result;
    result.numbers_ = true;
    if (map.empty())
        return result;
    SR_CHECK(result.apply(map));
    if (!result.knows(kNoLabel))
        result.set(kNoLabel, "nothing", kEmpty);
    return result;
}

void LabelMap::set(uint32_t source, std::string name, std::optional<uint8_t> target)
{
    entries_[source] = {std::move(name), target, 0};
}

Status LabelMap::apply(const LabelTable& table)
{
    if (table.whole)
        entries_.clear();
    for (const LabelTable::Label& label : table.labels) {
        if (label.number) {
            Entry& entry = entries_[*label.number];
            entry.target = label.target;
            entry.assumed = false;
            if (!label.name.empty())
                entry.name = label.name;
            continue;
        }
        bool found = false;
        for (auto& [number, entry] : entries_)
            if (same_class_name(entry.name, label.name)) {
                entry.target = label.target;
                entry.assumed = false;
                found = true;
            }
        if (!found)
            return fail(ErrorCode::bad_input, "{}: {}: the source has no label of that name", table.where,
                        quote(label.name, 60));
    }
    return {};
}

Status LabelMap::apply(const Path& name_or_file)
{
    SR_TRY(const LabelTable table, read_label_table(name_or_file));
    return apply(table);
}

uint8_t LabelMap::operator()(uint32_t source, uint64_t count)
{
    Entry& entry = entries_[source];
    entry.count += count;
    return entry.target.value_or(kLeftOut);
}

// "2 ground (48 points, terrain), 6 building (4 points), 77 (1 points, unknown)", as far as there were such
std::string LabelMap::listed(std::string_view things, bool assumed_only) const
{
    std::string list;
    size_t count = 0;
    for (const auto& [number, entry] : entries_) {
        if (!entry.count || (assumed_only && !entry.assumed) || ++count > kMostListed)
            continue;
        const std::string target = !entry.target                 ? "unknown"
                                   : *entry.target < kClassCount ? label_name(*entry.target)
                                   : *entry.target == kEmpty     ? "free"
                                                                 : "left out";
        list += fmt::format("{}{}{} ({} {}{})", list.empty() ? "" : ", ", number,
                            entry.name.empty() ? "" : " " + printable(entry.name, 60), entry.count, things,
                            entry.name == target ? "" : ", " + target);
    }
    if (count > kMostListed)
        list += fmt::format(" and {} more", count - kMostListed);
    return list;
}

// the tables that have all numbers that were looked up, " (they are all in ...)"
std::string LabelMap::known_to() const
{
    std::string names;
    for (const std::string_view name : label_table_names()) {
        auto table = LabelMap::of(name);
        const bool all = table && std::ranges::all_of(entries_, [&](const auto& e) {
                             return e.second.count == 0 || table->knows(e.first);
                         });
        if (all)
            names += fmt::format("{}{}", names.empty() ? "" : ", ", name);
    }
    return names.empty() ? "" : fmt::format("; all numbers of the file are in {}", names);
}

Status LabelMap::check(std::string_view where, std::string_view things, std::string_view advice) const
{
    const std::string all = listed(things, false);
    if (refused_ && !all.empty())
        return fail(ErrorCode::bad_input,
                    "{}: {}: a column of that name holds numbers of {}, not ours: {}; `map` {} takes them so, `map` "
                    "ours as our own, `map` of a file as it says",
                    where, quote(column_.name, 60), column_.table, all, column_.table);
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
    if (!numbers_)
        return fail(ErrorCode::bad_input, "{}: unknown labels: {}; {}", where, list, advice);
    const bool any_known =
        std::ranges::any_of(entries_, [](const auto& e) { return e.second.count && e.second.target; });
    return fail(ErrorCode::bad_input, "{}: unknown labels: {}; {}{}{}", where, list, advice,
                any_known ? "; found are " + all : "", known_to());
}

std::vector<std::string> LabelMap::assumed(std::string_view where, std::string_view things) const
{
    const std::string list = listed(things, true);
    if (list.empty())
        return {};
    return {fmt::format("{}: {}: the numbers are taken for our own classes: {}; `map` says what they are if they are "
                        "another program's",
                        where, quote(column_.name, 60), list)};
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
