// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/scene_objects.h"

#include "engine/scene/palette.h"
#include "engine/scene/scene_fields.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <set>

namespace semrover {

namespace {

using Triple = std::array<double, 3>;

constexpr const char* kFormat = "semrover.objects";
constexpr std::array<std::string_view, 4> kFileKeys = {"format", "version", "objects", "comment"};
constexpr std::array<std::string_view, 8> kObjectKeys = {"id",      "class", "center", "size",
                                                         "heading", "tint",  "part",   "comment"};
constexpr double kLargestAngle = 1e3;

Status check_heading(double heading, std::string_view where)
{
    if (!(std::abs(heading) <= kLargestAngle))
        return fail(ErrorCode::bad_input, "{}: heading: expected a number from {} to {}, found {}", where,
                    -kLargestAngle, kLargestAngle, heading);
    return {};
}

Result<std::optional<Triple>> tint_of(const Json& object, std::string_view where)
{
    const auto entry = object.find("tint");
    if (entry == object.end() || entry->is_null())
        return std::optional<Triple>();
    if (entry->is_string()) {
        SR_TRY(const Triple color, parse_tint(entry->get_ref<const std::string&>(), where));
        return std::optional(color);
    }
    SR_TRY(const Triple color, triple_at(object, "tint", 0, 1, where));
    return std::optional(color);
}

Result<SceneObject> parse_object(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kObjectKeys, where));
    SceneObject o;
    SR_TRY(o.id, id_at(json, where));
    SR_TRY(o.label, class_at(json, where));
    SR_TRY(o.center, triple_at(json, "center", -kFarthestThing, kFarthestThing, where));
    SR_TRY(o.size, triple_at(json, "size", kShortestSide, kLongestSide, where));
    const auto heading = json.find("heading");
    if (heading == json.end())
        return fail(ErrorCode::bad_input, "{}: heading is missing", where);
    SR_TRY(o.heading, finite_number(*heading, fmt::format("{}: heading", where)));
    SR_CHECK(check_heading(o.heading, where));
    SR_TRY(o.tint, tint_of(json, where));
    if (const auto part = json.find("part"); part != json.end()) {
        if (!part->is_boolean())
            return fail(ErrorCode::bad_input, "{}: part: expected true or false, found {}", where, part->dump());
        o.part = part->get<bool>();
    }
    return o;
}

constexpr double kPerRadian = 1e5, kPerTint = 1e3;

Json object_json(const SceneObject& object)
{
    const SceneObject o = as_written(object);
    Json json = {{"id", o.id},
                 {"class", std::string(kPalette[o.label].name)},
                 {"center", o.center},
                 {"size", o.size},
                 {"heading", o.heading}};
    if (o.tint)
        json["tint"] = *o.tint;
    if (o.part)
        json["part"] = true;
    return json;
}

} // namespace

Rigid box_to_world(const SceneObject& o)
{
    const double c = std::cos(o.heading), s = std::sin(o.heading);
    return {c, -s, 0, o.center[0], s, c, 0, o.center[1], 0, 0, 1, o.center[2], 0, 0, 0, 1};
}

ObjectsById by_id(std::span<const SceneObject> objects)
{
    ObjectsById all;
    for (const SceneObject& object : objects)
        all.emplace(object.id, &object);
    return all;
}

Result<Triple> parse_tint(std::string_view text, std::string_view where)
{
    uint32_t bits = 0;
    const char* end = text.data() + text.size();
    const bool shaped = text.size() == 7 && text[0] == '#';
    if (!shaped || std::from_chars(text.data() + 1, end, bits, 16).ptr != end)
        return fail(ErrorCode::bad_input, "{}: tint: expected #rrggbb, found {}", where, quote(text));
    return Triple{(bits >> 16) / 255.0, (bits >> 8 & 255) / 255.0, (bits & 255) / 255.0};
}

std::string tint_text(const Triple& tint)
{
    const auto level = [](double v) { return uint32_t(std::lround(std::clamp(v, 0.0, 1.0) * 255)); };
    return fmt::format("#{:02x}{:02x}{:02x}", level(tint[0]), level(tint[1]), level(tint[2]));
}

Result<std::vector<SceneObject>> parse_objects(const Json& json, std::string_view where)
{
    SR_TRY(const Json* list, things_in(json, kFormat, kFileKeys, "objects", kMaxObjects, where));
    std::vector<SceneObject> objects;
    std::set<uint32_t> ids;
    for (const Json& item : *list) {
        const std::string at = fmt::format("{}: object {}", where, objects.size() + 1);
        SR_TRY(SceneObject o, parse_object(item, at));
        if (!ids.insert(o.id).second)
            return fail(ErrorCode::bad_input, "{}: id {} is given twice", at, o.id);
        objects.push_back(std::move(o));
    }
    return objects;
}

Result<std::vector<SceneObject>> read_objects(const Path& path)
{
    SR_TRY(const Json json, read_json(path, {.bytes = 256u << 20, .values = 32u << 20, .containers = 4u << 20}));
    return parse_objects(json, quote_path(path));
}

SceneObject as_written(SceneObject o)
{
    for (size_t a = 0; a < 3; ++a) {
        o.center[a] = rounded_to(o.center[a], kPerMetre);
        o.size[a] = rounded_to(o.size[a], kPerMetre);
        if (o.tint)
            (*o.tint)[a] = rounded_to((*o.tint)[a], kPerTint);
    }
    o.heading = rounded_to(o.heading, kPerRadian);
    return o;
}

Path objects_beside(const Path& grid)
{
    return Path(grid).replace_extension(".objects.json");
}

Status check_object(const SceneObject& object, std::string_view where)
{
    for (double v : object.center)
        if (!(std::abs(v) <= kFarthestThing))
            return fail(ErrorCode::bad_input, "{}: center: expected numbers from {} to {}, found {}", where,
                        -kFarthestThing, kFarthestThing, v);
    for (double v : object.size)
        if (!(v >= kShortestSide && v <= kLongestSide))
            return fail(ErrorCode::bad_input, "{}: size: expected numbers from {} to {}, found {}", where,
                        kShortestSide, kLongestSide, v);
    return check_heading(object.heading, where);
}

Status write_objects(const Path& path, std::span<const SceneObject> objects)
{
    std::string text = fmt::format("{{\"format\": \"{}\", \"version\": 1, \"objects\": [", kFormat);
    for (size_t i = 0; i < objects.size(); ++i)
        text += (i ? ",\n " : "\n ") + json_text(object_json(objects[i]));
    return write_file_atomically(path, text + "\n]}\n");
}

} // namespace semrover
