// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json_fields.h"

namespace semrover {

constexpr uint64_t kMaxLineFile = 2ull << 30; // bytes

// Calls `record` with the object of each line of a .jsonl file, and with "FILE line N" for errors. A line without its
// end is refused: the file is cut. bad_input, and what `record` returns
Status read_json_lines(const Path& path, std::span<const std::string_view> keys,
                       const std::function<Status(const Json& object, const std::string& where)>& record);

Result<int64_t> whole_number(const Json& object, const char* key, std::string_view where);
Result<std::string> text_of(const Json& object, const char* key, std::string_view where);

} // namespace semrover
