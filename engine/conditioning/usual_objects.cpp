// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/usual_objects.h"

#include "engine/conditioning/scene_objects.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

constexpr std::array<std::string_view, 3> kKeys = {"size", "tints", "parts"};
constexpr std::array<std::string_view, 4> kPartsKeys = {"size", "pitch", "low", "tints"};
constexpr size_t kMaxTints = 4096;

Status check_object_of(const Json& json, std::span<const std::string_view> keys, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    return check_keys(json, keys, where);
}

template <size_t N>
Result<std::array<double, N>> lengths_at(const Json& json, const char* key, std::string_view where)
{
    SR_TRY(const std::vector<double> found, numbers_of(json.value(key, Json()), fmt::format("{}: {}", where, key)));
    if (found.size() != N)
        return fail(ErrorCode::bad_input, "{}: {}: expected {} numbers, found {}", where, key, N, found.size());
    std::array<double, N> lengths{};
    for (size_t a = 0; a < N; ++a) {
        if (!(found[a] >= 1e-3 && found[a] <= 1e3))
            return fail(ErrorCode::bad_input, "{}: {}: expected metres from 0.001 to 1000, found {}", where, key,
                        found[a]);
        lengths[a] = found[a];
    }
    return lengths;
}

Result<std::vector<std::array<double, 3>>> tints_at(const Json& json, std::string_view where)
{
    const Json list = json.value("tints", Json::array());
    if (!list.is_array() || list.size() > kMaxTints)
        return fail(ErrorCode::bad_input, "{}: tints: expected a list of at most {} colours", where, kMaxTints);
    std::vector<std::array<double, 3>> tints;
    for (const Json& tint : list) {
        SR_TRY(const auto color, parse_tint(tint.is_string() ? tint.get<std::string>() : json_text(tint), where));
        tints.push_back(color);
    }
    return tints;
}

Result<UsualParts> parse_usual_parts(const Json& json, std::string_view where)
{
    SR_CHECK(check_object_of(json, kPartsKeys, where));
    UsualParts parts;
    SR_TRY(parts.size, lengths_at<3>(json, "size", where));
    SR_TRY(parts.pitch, lengths_at<2>(json, "pitch", where));
    SR_TRY(parts.low, finite_number(json.value("low", Json()), fmt::format("{}: low", where)));
    if (!(parts.low >= 0 && parts.low <= 1e3))
        return fail(ErrorCode::bad_input, "{}: low: expected metres from 0 to 1000, found {}", where, parts.low);
    SR_TRY(parts.tints, tints_at(json, where));
    return parts;
}

Result<UsualObject> parse_usual_object(const Json& json, std::string_view where)
{
    SR_CHECK(check_object_of(json, kKeys, where));
    UsualObject usual;
    SR_TRY(usual.size, lengths_at<3>(json, "size", where));
    SR_TRY(usual.tints, tints_at(json, where));
    if (const auto parts = json.find("parts"); parts != json.end()) {
        SR_TRY(usual.parts, parse_usual_parts(*parts, fmt::format("{}: parts", where)));
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
