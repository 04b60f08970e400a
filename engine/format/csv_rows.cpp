// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/csv_rows.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kMostColumns = 4096;

} // namespace

Result<CsvRows> CsvRows::open(std::string_view text, std::string_view where)
{
    CsvRows rows(text, where);
    if (!rows.lines_.next())
        return fail(ErrorCode::bad_input, "{}: expected a line with the names of columns, found nothing", where);
    SR_CHECK(rows.split());
    rows.names_ = rows.values_;
    for (size_t i = 0; i < rows.names_.size(); ++i)
        if (rows.column(rows.names_[i]) != i)
            return fail(ErrorCode::bad_input, "{}: column {} is given twice", rows.where(), quote(rows.names_[i], 60));
    return rows;
}

std::string CsvRows::where() const
{
    return fmt::format("{} line {}", where_, lines_.number());
}

std::optional<size_t> CsvRows::column(std::string_view name) const
{
    const auto found = std::ranges::find(names_, name);
    if (found == names_.end())
        return std::nullopt;
    return size_t(found - names_.begin());
}

Result<size_t> CsvRows::need(std::string_view name) const
{
    if (const auto at = column(name))
        return *at;
    return fail(ErrorCode::bad_input, "{}: there is no column {}", where_, name);
}

Status CsvRows::split()
{
    values_.clear();
    std::string_view line = lines_.line();
    if (line.ends_with('\r'))
        line.remove_suffix(1);
    for (bool more = true; more;) {
        const size_t comma = line.find(',');
        std::string_view value = line.substr(0, comma);
        more = comma != std::string_view::npos;
        line.remove_prefix(more ? comma + 1 : line.size());
        if (value.size() >= 2 && value.starts_with('"') && value.ends_with('"'))
            value = value.substr(1, value.size() - 2);
        if (value.find('"') != std::string_view::npos)
            return fail(ErrorCode::bad_input, "{}: a value with a quote or a comma inside: {}", where(),
                        quote(value, 60));
        if (values_.size() == kMostColumns)
            return fail(ErrorCode::bad_input, "{}: expected at most {} values, found more", where(), kMostColumns);
        values_.push_back(value);
    }
    return {};
}

Result<bool> CsvRows::next()
{
    do {
        if (!lines_.next())
            return false;
    } while (count_words(lines_.line()) == 0);
    SR_CHECK(split());
    if (values_.size() != names_.size())
        return fail(ErrorCode::bad_input, "{}: expected {} values, found {}", where(), names_.size(), values_.size());
    return true;
}

} // namespace semrover
