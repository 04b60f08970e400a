// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/editing/editing.h"

#include "engine/conditioning/scene_objects.h"
#include "engine/scene/palette.h"
#include "runtime/base/inner_path.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

using Kind = EditOperation::Kind;

constexpr std::array kKinds = {Kind::remove, Kind::erase, Kind::paint, Kind::insert,
                               Kind::copy,   Kind::move,  Kind::tint};

// `count` numbers under a key; none when the object has no such key
Result<std::vector<double>> array_of(const Json& object, const char* key, size_t count, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end())
        return std::vector<double>();
    SR_TRY(std::vector<double> values, numbers_of(*entry, fmt::format("{}: {}", where, key)));
    if (values.size() != count)
        return fail(ErrorCode::bad_input, "{}: {}: expected {} numbers, found {}", where, key, count, values.size());
    return values;
}

Result<std::string> text_of(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end())
        return std::string();
    if (!entry->is_string())
        return fail(ErrorCode::bad_input, "{}: {}: expected a string, found {}", where, key, entry->type_name());
    return entry->get<std::string>();
}

// an error of a parser that is shared with the command line is one of the file here
template <typename T>
Result<T> in_file(Result<T> result, std::string_view where)
{
    if (result)
        return result;
    return fail(ErrorCode::bad_input, "{}: {}", where, result.error().message);
}

Status in_file(const Status& status, std::string_view where)
{
    if (status)
        return {};
    return fail(ErrorCode::bad_input, "{}: {}", where, status.error().message);
}

Result<CellSelection> parse_selection(const Json& json, std::string_view where)
{
    CellSelection s;
    SR_TRY(const std::string name, text_of(json, "class", where));
    if (!name.empty() && name != "all") {
        SR_TRY(s.label, in_file(parse_class(name), where));
    }
    SR_TRY(const auto box, array_of(json, "box", 6, where));
    if (!box.empty()) {
        s.box = WorldBox{{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
        SR_CHECK(in_file(check_box(*s.box), where));
    }
    SR_TRY(const auto sphere, array_of(json, "sphere", 4, where));
    if (!sphere.empty()) {
        s.sphere = WorldSphere{{sphere[0], sphere[1], sphere[2]}, sphere[3]};
        SR_CHECK(in_file(check_sphere(*s.sphere), where));
    }
    SR_TRY(const auto object, array_of(json, "object", 3, where));
    if (object.empty())
        return s;
    s.object.emplace();
    for (size_t a = 0; a < 3; ++a) {
        if (object[a] != std::floor(object[a]) || std::abs(object[a]) > 1 << 20)
            return fail(ErrorCode::bad_input, "{}: object: expected the index of a voxel, found {}", where, object[a]);
        (*s.object)[a] = int32_t(object[a]);
    }
    return s;
}

Result<std::optional<std::array<double, 3>>> point_of(const Json& json, const char* key, std::string_view where)
{
    SR_TRY(const auto v, array_of(json, key, 3, where));
    if (v.empty())
        return std::optional<std::array<double, 3>>();
    const std::array<double, 3> p = {v[0], v[1], v[2]};
    SR_CHECK(in_file(check_box({p, p}), fmt::format("{}: {}", where, key)));
    return std::optional(p);
}

constexpr std::array<std::string_view, 13> kKeys = {"op",    "class", "box", "sphere", "object", "label", "fill",
                                                    "stamp", "at",    "by",  "rotate", "points", "color"};

Result<EditOperation> parse_operation(const Json& json, const Path& folder, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kKeys, where));
    EditOperation o;
    SR_TRY(const std::string name, text_of(json, "op", where));
    const auto kind = std::ranges::find(kKinds, name, operation_name);
    if (kind == kKinds.end())
        return fail(ErrorCode::bad_input,
                    "{}: op: expected remove, delete, paint, insert, copy, move or tint, found {}", where, quote(name));
    o.kind = *kind;
    SR_TRY(o.where, parse_selection(json, where));
    if (json.contains("label") != (o.kind == Kind::paint))
        return fail(ErrorCode::bad_input, "{}: paint, and nothing else, has a label", where);
    if (o.kind == Kind::paint) {
        SR_TRY(const std::string label, text_of(json, "label", where));
        SR_TRY(o.label, in_file(parse_class(label), where));
    }
    if (json.contains("color") != (o.kind == Kind::tint))
        return fail(ErrorCode::bad_input, "{}: tint, and nothing else, has a color", where);
    if (o.kind == Kind::tint) {
        SR_TRY(const std::string color, text_of(json, "color", where));
        SR_TRY(o.color, parse_tint(color, where));
    }
    if (json.contains("fill") && !json["fill"].is_boolean())
        return fail(ErrorCode::bad_input, "{}: fill: expected true or false", where);
    o.fill = json.value("fill", false);
    SR_TRY(const std::string stamp, text_of(json, "stamp", where));
    if (!stamp.empty()) {
        // a script may come from elsewhere, and what it names is read
        const Path given = stamp, path = given.has_root_path() ? given.lexically_relative(folder) : given;
        o.stamp = folder / path;
        const bool leaves = is_there(o.stamp) && !lies_inside(folder, o.stamp); // through a link
        if (!leads_inside(path.string()) || std::ranges::find(path, "..") != path.end() || leaves)
            return fail(ErrorCode::bad_input, "{}: stamp: expected a file in the script's folder, found {}", where,
                        quote(stamp));
    }
    SR_TRY(o.at, point_of(json, "at", where));
    SR_TRY(o.by, point_of(json, "by", where));
    SR_TRY(const auto degrees, optional_number(json, "rotate", where));
    SR_TRY(o.quarter_turns, in_file(quarter_turns(degrees.value_or(0)), where));
    SR_TRY(const std::string points, text_of(json, "points", where));
    SR_TRY(o.keep_points, in_file(keeps_points(points.empty() ? "regenerate" : points), where));
    if (const Status sound = check_operation(o, where); !sound)
        return fail(ErrorCode::bad_input, "{}", sound.error().message);
    return o;
}

} // namespace

Result<int> quarter_turns(double degrees)
{
    for (int turns = 0; turns < 4; ++turns)
        if (degrees == 90 * turns)
            return turns;
    return fail(ErrorCode::usage, "rotate: expected 0, 90, 180 or 270 degrees, found {}", degrees);
}

Result<bool> keeps_points(std::string_view text)
{
    if (text != "keep" && text != "regenerate")
        return fail(ErrorCode::usage, "points: expected keep or regenerate, found {}", quote(text));
    return text == "keep";
}

Result<std::vector<EditOperation>> parse_edit_script(const Json& json, const Path& folder, std::string_view where)
{
    const Json* list =
        json.is_object() && json.size() == 1 && json.contains("operations") ? &json["operations"] : &json;
    if (!list->is_array() || list->empty())
        return fail(ErrorCode::bad_input, "{}: expected an array of operations, found {}", where,
                    list->is_array() ? "an empty one" : list->type_name());
    std::vector<EditOperation> operations;
    for (const Json& item : *list) {
        SR_TRY(EditOperation o,
               parse_operation(item, folder, fmt::format("{}: operation {}", where, operations.size() + 1)));
        operations.push_back(std::move(o));
    }
    return operations;
}

Result<std::vector<EditOperation>> read_edit_script(const Path& path)
{
    SR_TRY(const Json json, read_json(path));
    return parse_edit_script(json, path.parent_path(), quote_path(path));
}

Json selection_json(const CellSelection& s)
{
    Json json = Json::object();
    if (s.label)
        json["class"] = std::string(kPalette[*s.label].name);
    if (s.box)
        json["box"] = {s.box->low[0], s.box->low[1], s.box->low[2], s.box->high[0], s.box->high[1], s.box->high[2]};
    if (s.sphere)
        json["sphere"] = {s.sphere->center[0], s.sphere->center[1], s.sphere->center[2], s.sphere->radius};
    if (s.object)
        json["object"] = *s.object;
    return json;
}

Json operation_json(const EditOperation& o)
{
    Json json = selection_json(o.where);
    json["op"] = std::string(operation_name(o.kind));
    if (o.kind == Kind::paint) {
        json["label"] = std::string(kPalette[o.label].name);
        json["fill"] = o.fill;
    }
    if (o.kind == Kind::tint)
        json["color"] = tint_text(o.color);
    if (o.kind == Kind::insert)
        json["stamp"] = o.stamp.string();
    if (o.at)
        json["at"] = *o.at;
    if (o.by)
        json["by"] = *o.by;
    if (o.at || o.by) {
        json["rotate"] = 90 * o.quarter_turns;
        json["points"] = o.keep_points ? "keep" : "regenerate";
    }
    return json;
}

} // namespace semrover
