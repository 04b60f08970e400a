// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/json_lines.h"

#include "runtime/base/quote.h"

namespace semrover {

Status read_json_lines(const Path& path, std::span<const std::string_view> keys,
                       const std::function<Status(const Json& object, const std::string& where)>& record)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const auto bytes = file.bytes();
    if (bytes.size() > kMaxLineFile)
        return fail(ErrorCode::bad_input, "{} has {} bytes, at most {} are read", quote_path(path), bytes.size(),
                    kMaxLineFile);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const std::string name = quote_path(path);
    size_t number = 0;
    for (size_t at = 0; at < text.size(); ++number) {
        const size_t end = text.find('\n', at);
        const std::string where = fmt::format("{} line {}", name, number + 1);
        if (end == std::string_view::npos)
            return fail(ErrorCode::bad_input, "{}: the line has no end, the file is cut", where);
        SR_TRY(const Json object, parse_json(text.substr(at, end - at), where));
        if (!object.is_object())
            return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, object.type_name());
        SR_CHECK(check_keys(object, keys, where));
        SR_CHECK(record(object, where));
        at = end + 1;
    }
    return {};
}

Result<int64_t> whole_number(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_number_integer() ||
        (entry->is_number_unsigned() && entry->get<uint64_t>() > uint64_t(INT64_MAX)))
        return fail(ErrorCode::bad_input, "{}: {}: expected a whole number", where, key);
    return entry->get<int64_t>();
}

Result<std::string> text_of(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_string())
        return fail(ErrorCode::bad_input, "{}: {}: expected a text", where, key);
    return entry->get<std::string>();
}

} // namespace semrover
