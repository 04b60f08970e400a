// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <cstdint>
#include <optional>
#include <utility>

namespace semrover {

// A value of a job file, TOML or JSON, and where it stands.
struct JobValue {
    enum class Kind : uint8_t { text, integer, number, boolean, list, table };

    Kind kind = Kind::table;
    std::string text = {}; // of a number its digits, of a boolean "true" or "false"
    std::vector<JobValue> items = {};
    std::vector<std::pair<std::string, JobValue>> members = {}; // in the file's order
    uint32_t line = 0, column = 0;                              // of a table's member, its key's; from 1

    const JobValue* find(std::string_view key) const; // null where it is not there
    bool is_single() const { return kind != Kind::list && kind != Kind::table; }
};

// What stands at a value, in words: "a table"
std::string_view kind_name(JobValue::Kind kind);

// A .toml file; with the extension .json the same as JSON. bad_input, with line and column: what is neither, and what
// has no meaning in a job, as dates and null. At most 16 MiB
Result<JobValue> read_job_tree(const Path& path);

} // namespace semrover
