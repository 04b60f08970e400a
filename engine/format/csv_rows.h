// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/camera_text.h"

#include <optional>
#include <string>
#include <vector>

namespace semrover {

// The rows of a table as text: a line with names, then lines of values, with commas between. Values may stand in double
// quotes, but hold neither commas nor quotes. Views into the text.
class CsvRows {
  public:
    // reads the names; bad_input for names given twice, and for more than 4096
    static Result<CsvRows> open(std::string_view text, std::string_view where);

    std::optional<size_t> column(std::string_view name) const;
    Result<size_t> need(std::string_view name) const; // bad_input when there is no such column

    // To the first row, and on; false at the end. Skips empty lines. bad_input for a row with another number of values
    Result<bool> next();
    std::string_view value(size_t column) const { return values_[column]; }
    std::string where() const; // "'t.csv' line 3"

  private:
    CsvRows(std::string_view text, std::string_view where) : lines_(text), where_(where) {}
    Status split();

    TextLines lines_;
    std::string where_;
    std::vector<std::string_view> names_, values_;
};

} // namespace semrover
