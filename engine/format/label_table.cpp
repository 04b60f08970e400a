// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/label_map.h"

#include "label_maps_json.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>

namespace semrover {

namespace {

// CloudCompare writes scalar_ in front of a name; classification is what LAS calls it, semantic what KITTI-360 does,
// ObjTag what CARLA's semantic lidar does
constexpr LabelColumn kColumns[] = {
    {"label", ""},
    {"class", ""},
    {"semantic", "kitti360"},
    {"semantic_label", ""},
    {"class_id", ""},
    {"classification", "asprs"},
    {"Classification", "asprs"},
    {"category", ""},
    {"category_id", ""},
    {"objtag", "carla"},
    {"ObjTag", "carla"},
    {"scalar_label", ""},
    {"scalar_Label", ""},
    {"scalar_class", ""},
    {"scalar_semantic", "kitti360"},
    {"scalar_Classification", "asprs"},
    {"scalar_classification", "asprs"},
};

constexpr std::string_view kOurs = "ours";
constexpr JsonLimits kTableLimits{.bytes = 1 << 20, .depth = 2, .values = 100000};

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
    if (value.is_string()) {
        if (const auto label = class_of_name(value.get<std::string>()))
            return *label;
        if (value == "free")
            return kEmpty;
    }
    return fail(ErrorCode::bad_input, "{}: expected a class (name or 0 to {}), null or \"free\", found {}", where,
                kClassCount - 1, printable(json_text(value, -1, true), 60));
}

Result<LabelTable::Label> label_of(const std::string& key, const Json& value, const std::string& where)
{
    LabelTable::Label label{number_of_key(key), {}, kLeftOut};
    if (!label.number)
        label.name = key;
    const Json* target = &value;
    if (value.is_object()) {
        const auto name = value.find("name"), own = value.find("class");
        if (!label.number || value.size() != 2 || name == value.end() || !name->is_string() || own == value.end())
            return fail(ErrorCode::bad_input, "{}: expected {{\"name\": .., \"class\": ..}} of a number, found {}",
                        where, printable(json_text(value, -1, true), 60));
        label.name = name->get<std::string>();
        target = &*own;
    }
    SR_TRY(label.target, target_of(*target, where));
    return label;
}

Result<LabelTable> table_of(const Json& json, std::string where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object of source label to class, found {}", where,
                    json.type_name());
    LabelTable table{std::move(where), {}, false};
    for (const auto& [key, value] : json.items()) {
        SR_TRY(LabelTable::Label label, label_of(key, value, fmt::format("{}: {}", table.where, quote(key, 60))));
        table.labels.push_back(std::move(label));
    }
    table.whole = !table.labels.empty() && std::ranges::all_of(table.labels, [](const LabelTable::Label& l) {
        return l.number && !l.name.empty();
    });
    return table;
}

LabelTable our_table()
{
    LabelTable table{std::string(kOurs), {}, true};
    for (uint8_t i = 0; i < kClassCount; ++i)
        table.labels.push_back({i, std::string(kPalette[i].name), i});
    return table;
}

} // namespace

std::span<const LabelColumn> label_columns()
{
    return kColumns;
}

bool says_own_labels(const std::vector<std::string>& comments)
{
    return std::ranges::find(comments, kOwnLabelsComment) != comments.end();
}

Result<LabelTable> read_label_table(const Path& name_or_file)
{
    const std::string name = name_or_file.string();
    if (name == kOurs)
        return our_table();
    for (const LabelMapAsset& asset : kLabelMapAssets)
        if (asset.name == name) {
            SR_TRY(const Json json, parse_json(asset.json, name, kTableLimits));
            return table_of(json, name);
        }
    if (!is_there(name_or_file))
        return fail(ErrorCode::bad_input, "{}: expected a file, or one of the tables {}", quote_path(name_or_file),
                    fmt::join(label_table_names(), ", "));
    SR_TRY(const Json json, read_json(name_or_file, kTableLimits));
    return table_of(json, quote_path(name_or_file));
}

std::vector<std::string_view> label_table_names()
{
    std::vector<std::string_view> names{kOurs};
    for (const LabelMapAsset& asset : kLabelMapAssets)
        names.push_back(asset.name);
    return names;
}

} // namespace semrover
