// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// a column of label numbers as programs call it
struct LabelColumn {
    std::string_view name;
    std::string_view table; // whose numbers columns of that name hold (label_table.h); empty: anybody's
};

// of points and of faces; the first that a file has counts
std::span<const LabelColumn> label_columns();

// the line of a header that says that its labels are our own classes
constexpr std::string_view kOwnLabelsComment = "label: class of semrover";
bool says_own_labels(const std::vector<std::string>& comments);

} // namespace semrover
