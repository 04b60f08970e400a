// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"

namespace semrover {

// fields of boxes in JSON; bad_input with `where` and the key in front

inline Result<std::string> text_at(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_string())
        return fail(ErrorCode::bad_input, "{}: {}: expected a string", where, key);
    return entry->get<std::string>();
}

// Calls `record` with each record of a table of nuScenes' and with its place, for errors. The tables of the whole data
// set have gigabytes; only one record of them is in memory at a time. Errors: bad_input; of `record`
inline Status for_each_record(const Path& path,
                              const std::function<Status(const Json&, std::string_view where)>& record)
{
    constexpr JsonLimits kTable = {.bytes = 4ull << 30, .depth = 8, .values = 1 << 12};
    const std::string name = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view bytes(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    SR_TRY(const std::string_view text, text_after_mark(bytes, name));
    return parse_json_records(text, name, kTable, [&](const Json& json, size_t number) -> Status {
        const std::string where = fmt::format("{} record {}", name, number);
        if (!json.is_object())
            return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
        return record(json, where);
    });
}

} // namespace semrover
