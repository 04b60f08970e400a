// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/palette.h"
#include "runtime/base/file.h"

#include <optional>
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

constexpr uint8_t kLeftOut = 254; // a source label whose voxels stay empty
constexpr uint8_t kEmpty = 255;   // free space in the source

// What labels of another program are here. JSON: an object of source label to target. The source is a number or a name,
// the target a class (name or number), null (left out) or "free". Where it is {"name": .., "class": target} the number
// has that name.
struct LabelTable {
    struct Label {
        std::optional<uint32_t> number; // none: known by name only
        std::string name;               // empty: known by number only
        uint8_t target;                 // a class, kLeftOut or kEmpty
    };
    std::string where; // for messages: the file, or the table's name
    std::vector<Label> labels;
    // All numbers are named: these are all numbers that there are, and others are unknown. Else the table overrides
    // what is known without it.
    bool whole = false;
};

// The table of --map: a name of label_table_names(), or else a file. bad_input lists the names, or names the entry.
Result<LabelTable> read_label_table(const Path& name_or_file);

// the names of the files in assets/label_maps, which are compiled in, and `ours`: our own numbers
std::vector<std::string_view> label_table_names();

} // namespace semrover
