// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/usual_objects.h"

#include "engine/scene/scene_objects.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

constexpr std::array<std::string_view, 2> kKeys = {"size", "tints"};
constexpr size_t kMaxTints = 4096;

Result<UsualObject> parse_usual_object(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kKeys, where));
    UsualObject usual;
    SR_TRY(const std::vector<double> size, numbers_of(json.value("size", Json()), fmt::format("{}: size", where)));
    if (size.size() != 3)
        return fail(ErrorCode::bad_input, "{}: size: expected 3 numbers, found {}", where, size.size());
    for (size_t a = 0; a < 3; ++a) {
        if (!(size[a] >= 1e-3 && size[a] <= 1e3))
            return fail(ErrorCode::bad_input, "{}: size: expected metres from 0.001 to 1000, found {}", where, size[a]);
        usual.size[a] = size[a];
    }
    const Json tints = json.value("tints", Json::array());
    if (!tints.is_array() || tints.size() > kMaxTints)
        return fail(ErrorCode::bad_input, "{}: tints: expected a list of at most {} colours", where, kMaxTints);
    for (const Json& tint : tints) {
        SR_TRY(const auto color, parse_tint(tint.is_string() ? tint.get<std::string>() : tint.dump(), where));
        usual.tints.push_back(color);
    }
    return usual;
}

} // namespace

Result<UsualObjects> parse_usual_objects(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    UsualObjects objects;
    for (const auto& [name, value] : json.items()) {
        const auto label = class_of_name(name);
        if (!label)
            return fail(ErrorCode::bad_input, "{}: there is no class {}", where, quote(name));
        SR_TRY(objects[*label], parse_usual_object(value, fmt::format("{}: {}", where, name)));
    }
    return objects;
}

} // namespace semrover
