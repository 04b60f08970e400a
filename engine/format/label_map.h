// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/palette.h"
#include "runtime/base/file.h"

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// a column of label numbers as programs call it
struct LabelColumn {
    std::string_view name;
    std::string_view table; // whose numbers columns of that name hold; empty: anybody's
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

// what a format calls its classes
struct SourceLabel {
    uint32_t number;
    std::string_view name;
    uint8_t target; // a class, kLeftOut or kEmpty
};

std::vector<SourceLabel> source_labels(const LabelTable& whole); // views of its names

constexpr std::string_view kMapAdvice = "`map` says what they are";

// Maps source label numbers to classes, and counts the lookups of each.
class LabelMap {
  public:
    LabelMap() = default;
    explicit LabelMap(std::span<const SourceLabel> labels);
    static LabelMap identity();                         // 0..19 are the classes themselves
    static Result<LabelMap> of(std::string_view table); // of label_table_names()
    // Of a column of a file; `ours`: the file says that we wrote it. `map` (empty: none) overrides our classes, and is
    // all that there is of a column that is another program's. Without a map check() refuses such a column.
    static Result<LabelMap> of_column(const LabelColumn& column, bool ours, const Path& map);

    // Of an array: only `map` knows its numbers. 255 is empty in a map that does not know it.
    static Result<LabelMap> of_array(const Path& map);

    void set(uint32_t source, std::string name, std::optional<uint8_t> target); // none: known by name only

    // Takes a table of --map. A whole one replaces the others, another's entries override theirs. bad_input names the
    // entry: also for a name that no label has.
    Status apply(const LabelTable& table);
    Status apply(const Path& name_or_file); // read_label_table

    bool knows(uint32_t source) const { return entries_.contains(source); }

    // a class, kLeftOut (also for an unknown label) or kEmpty
    uint8_t operator()(uint32_t source, uint64_t count = 1);

    // bad_input if unknown labels were looked up: one line with their counts, `advice` at its end, and the tables that
    // know all of the numbers; also for a column that of_column refuses, with all numbers and what they would be
    Status check(std::string_view where, std::string_view things, std::string_view advice = kMapAdvice) const;
    // a line if numbers of anybody's column were taken for ours, which says for which classes; else none
    std::vector<std::string> assumed(std::string_view where, std::string_view things) const;
    // "4 of label 99 (other-object)", a line for each source label that was left out
    std::vector<std::string> left_out(std::string_view things) const;
    uint64_t dropped() const; // how many were left out

  private:
    struct Entry {
        std::string name;
        std::optional<uint8_t> target; // none: unknown
        uint64_t count = 0;
        bool assumed = false; // nothing says that the number is ours
    };
    std::string listed(std::string_view things, bool assumed_only) const;
    std::string known_to() const;

    std::map<uint32_t, Entry> entries_;
    LabelColumn column_; // of_column
    bool refused_ = false, numbers_ = false;
};

} // namespace semrover
