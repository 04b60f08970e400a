// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json_numbers.h"

namespace semrover {

// fields of boxes in JSON; bad_input with `where` and the key in front

inline Result<std::string> text_at(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end() || !entry->is_string())
        return fail(ErrorCode::bad_input, "{}: {}: expected a string", where, key);
    return entry->get<std::string>();
}

} // namespace semrover
