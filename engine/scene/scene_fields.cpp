// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/scene_fields.h"

#include "engine/scene/palette.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

namespace semrover {

Result<const Json*> things_in(const Json& file, const char* format, std::span<const std::string_view> keys,
                              const char* name, size_t most, std::string_view where)
{
    if (!file.is_object() || file.value("format", Json()) != format)
        return fail(ErrorCode::bad_input, "{}: expected an object with \"format\": \"{}\"", where, format);
    if (file.value("version", Json()) != 1)
        return fail(ErrorCode::bad_input, "{}: version: expected 1, found {}", where,
                    json_text(file.value("version", Json())));
    SR_CHECK(check_keys(file, keys, where));
    const auto list = file.find(name);
    if (list == file.end() || !list->is_array() || list->size() > most)
        return fail(ErrorCode::bad_input, "{}: {}: expected an array of at most {}", where, name, most);
    return &*list;
}

Result<uint32_t> id_at(const Json& thing, std::string_view where)
{
    const auto id = thing.find("id");
    if (id == thing.end() || !id->is_number_unsigned() || id->get<uint64_t>() > UINT32_MAX)
        return fail(ErrorCode::bad_input, "{}: id: expected a whole number from 0 to {}", where, UINT32_MAX);
    return id->get<uint32_t>();
}

Result<uint8_t> class_at(const Json& thing, std::string_view where)
{
    const auto entry = thing.find("class");
    if (entry == thing.end() || !entry->is_string())
        return fail(ErrorCode::bad_input, "{}: class: expected the name of a class", where);
    const std::string& name = entry->get_ref<const std::string&>();
    const auto label = class_of_name(name);
    if (!label)
        return fail(ErrorCode::bad_input, "{}: class: there is no class {}", where, quote(name));
    return *label;
}

Result<std::array<double, 3>> triple_at(const Json& thing, const char* key, double low, double high,
                                        std::string_view where)
{
    SR_TRY(const auto values, numbers_at<3>(thing, key, where));
    for (double v : values)
        if (v < low || v > high)
            return fail(ErrorCode::bad_input, "{}: {}: expected a number from {} to {}, found {}", where, key, low,
                        high, v);
    return values;
}

} // namespace semrover
