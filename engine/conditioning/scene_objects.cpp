// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/scene_objects.h"

#include "engine/scene/palette.h"
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
constexpr double kFarthest = 1e6, kShortest = 1e-3, kLongest = 1e4, kLargestAngle = 1e3;

Status check_within(double value, double low, double high, std::string_view where)
{
    if (value < low || value > high)
        return fail(ErrorCode::bad_input, "{}: expected a number from {} to {}, found {}", where, low, high, value);
    return {};
}

Result<Triple> triple_of(const Json& object, const char* key, double low, double high, std::string_view where)
{
    SR_TRY(const Triple values, numbers_at<3>(object, key, where));
    for (double value : values)
        SR_CHECK(check_within(value, low, high, fmt::format("{}: {}", where, key)));
    return values;
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
    SR_TRY(const Triple color, triple_of(object, "tint", 0, 1, where));
    return std::optional(color);
}

Result<uint8_t> class_of(const Json& object, std::string_view where)
{
    const auto entry = object.find("class");
    if (entry == object.end() || !entry->is_string())
        return fail(ErrorCode::bad_input, "{}: class: expected the name of a class", where);
    const std::string& name = entry->get_ref<const std::string&>();
    const auto label = class_of_name(name);
    if (!label)
        return fail(ErrorCode::bad_input, "{}: class: there is no class {}", where, quote(name));
    return *label;
}

Result<SceneObject> parse_object(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kObjectKeys, where));
    SceneObject o;
    const auto id = json.find("id");
    if (id == json.end() || !id->is_number_unsigned() || id->get<uint64_t>() > UINT32_MAX)
        return fail(ErrorCode::bad_input, "{}: id: expected a whole number from 0 to {}", where, UINT32_MAX);
    o.id = id->get<uint32_t>();
    SR_TRY(o.label, class_of(json, where));
    SR_TRY(o.center, triple_of(json, "center", -kFarthest, kFarthest, where));
    SR_TRY(o.size, triple_of(json, "size", kShortest, kLongest, where));
    const auto heading = json.find("heading");
    if (heading == json.end())
        return fail(ErrorCode::bad_input, "{}: heading is missing", where);
    SR_TRY(o.heading, finite_number(*heading, fmt::format("{}: heading", where)));
    SR_CHECK(check_within(o.heading, -kLargestAngle, kLargestAngle, fmt::format("{}: heading", where)));
    SR_TRY(o.tint, tint_of(json, where));
    if (const auto part = json.find("part"); part != json.end()) {
        if (!part->is_boolean())
            return fail(ErrorCode::bad_input, "{}: part: expected true or false, found {}", where, part->dump());
        o.part = part->get<bool>();
    }
    return o;
}

double rounded(double value, double per_unit)
{
    return std::round(value * per_unit) / per_unit + 0.0; // no -0
}

constexpr double kPerMetre = 1e4, kPerRadian = 1e5, kPerTint = 1e3;

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
    if (!json.is_object() || json.value("format", Json()) != kFormat)
        return fail(ErrorCode::bad_input, "{}: expected an object with \"format\": \"{}\"", where, kFormat);
    if (json.value("version", Json()) != 1)
        return fail(ErrorCode::bad_input, "{}: version: expected 1, found {}", where,
                    json.value("version", Json()).dump());
    SR_CHECK(check_keys(json, kFileKeys, where));
    const auto list = json.find("objects");
    if (list == json.end() || !list->is_array() || list->size() > kMaxObjects)
        return fail(ErrorCode::bad_input, "{}: objects: expected an array of at most {}", where, kMaxObjects);
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
        o.center[a] = rounded(o.center[a], kPerMetre);
        o.size[a] = rounded(o.size[a], kPerMetre);
        if (o.tint)
            (*o.tint)[a] = rounded((*o.tint)[a], kPerTint);
    }
    o.heading = rounded(o.heading, kPerRadian);
    return o;
}

Path objects_beside(const Path& grid)
{
    return Path(grid).replace_extension(".objects.json");
}

Status check_object(const SceneObject& object, std::string_view where)
{
    for (double v : object.center)
        if (!(std::abs(v) <= kFarthest))
            return fail(ErrorCode::bad_input, "{}: center: expected numbers from {} to {}, found {}", where, -kFarthest,
                        kFarthest, v);
    for (double v : object.size)
        if (!(v >= kShortest && v <= kLongest))
            return fail(ErrorCode::bad_input, "{}: size: expected numbers from {} to {}, found {}", where, kShortest,
                        kLongest, v);
    if (!(std::abs(object.heading) <= kLargestAngle))
        return fail(ErrorCode::bad_input, "{}: heading: expected a number from {} to {}, found {}", where,
                    -kLargestAngle, kLargestAngle, object.heading);
    return {};
}

Status write_objects(const Path& path, std::span<const SceneObject> objects)
{
    std::string text = fmt::format("{{\"format\": \"{}\", \"version\": 1, \"objects\": [", kFormat);
    for (size_t i = 0; i < objects.size(); ++i)
        text += (i ? ",\n " : "\n ") + object_json(objects[i]).dump();
    return write_file_atomically(path, text + "\n]}\n");
}

} // namespace semrover
